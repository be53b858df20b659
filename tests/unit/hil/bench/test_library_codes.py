"""No scenario of the library raises a false trouble code."""

from importlib import resources

import pytest

from hil.bench.virtual import own_nodes, simulate
from hil.scenario.scenario import load_scenario

MEANT = {
    "motor_dead_mid_stop": {"motor_fl_failed"},
    # it starts backwards: the observer takes no wheel for one that turns as the car moves
    "decide_reverse_and_forward": {
        "wheel_speed_both_axles", *(f"wheel_speed_{wheel}_implausible" for wheel in ("fl", "fr", "rl", "rr")),
    },
}  # fmt: skip
NAMES = sorted(
    entry.name.removesuffix(".toml")
    for entry in (resources.files("hil.scenario") / "library").iterdir()
    if entry.name.endswith(".toml")
)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_codes_of_the_library(name):
    scenario = load_scenario(name)
    plant, ecu = own_nodes(scenario, 1)
    simulate(scenario, plant=plant, ecu=ecu)
    assert {trouble.code.name for trouble in ecu.trouble_codes} == MEANT.get(name, set())

"""No scenario of the library raises a false trouble code."""

from importlib import resources

import pytest

from hil.bench.virtual import own_nodes, simulate
from hil.scenario.scenario import load_scenario

MEANT = {"motor_dead_mid_stop": {"motor_fl_failed"}}
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

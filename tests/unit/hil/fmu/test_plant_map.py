"""The map from signals to variables of somebody else's FMU."""

import pytest

from hil.fmu.plant_map import Source, Term, load_plant_map
from hil.scenario.table import ScenarioError

SPEED = '[outputs]\n"TRUTH_MOTION.SPEED" = "v"\n'


def load(tmp_path, text):
    path = tmp_path / "map.toml"
    path.write_text(text)
    return load_plant_map(path)


def test_all_forms_of_an_entry(tmp_path):
    found = load(
        tmp_path,
        """
step_s = 0.005
[parameters]
mass = 1500
[inputs]
a = "DRIVER.PEDAL"
f = [{ signal = "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", factor = -2.0 }, { signal = "DRIVER.PEDAL" }]
g = { value = 9.81 }
[outputs]
"TRUTH_MOTION.SPEED" = { fmu = "v", factor = 0.5, offset = 20.0, noise = 0.1 }
"BODY_MOTION.YAW_RATE" = "w"
"BATTERY_STATUS.STATE_OF_CHARGE" = { signal = "DRIVER.PEDAL" }
""",
    )
    assert (found.step_s, found.parameters) == (0.005, {"mass": 1500.0})
    assert found.inputs == {
        "a": Source((Term("signal", "DRIVER.PEDAL"),)),
        "f": Source((Term("signal", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", -2.0), Term("signal", "DRIVER.PEDAL"))),
        "g": Source((Term("value", "", 9.81),)),
    }
    assert found.outputs["TRUTH_MOTION.SPEED"] == Source((Term("fmu", "v", 0.5), Term("value", "", 20.0)), 0.1)
    assert found.outputs["BATTERY_STATUS.STATE_OF_CHARGE"].terms == (Term("signal", "DRIVER.PEDAL"),)
    assert found.wanted == ["v", "w"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[outputs]\n", "expected the car's speed"),
        (SPEED + '"WHEELS.SPEED" = "w"\n', "no signal of the car"),
        (SPEED + '"TRUTH_MOTION.MANOEUVRE" = "w"\n', "no signal of the car"),
        (SPEED + '[inputs]\nf = "PEDAL"\n', "'PEDAL' is nothing that the car is asked"),
        (SPEED + '[inputs]\nf = { signal = "DRIVER.PEDAL", gain = 2 }\n', "unknown key 'gain'"),
        (SPEED + "[parameters]\nm = true\n", "expected a number"),
        (SPEED + "[output]\n", "unknown key 'output'"),
        ("step_s = -1\n" + SPEED, "step_s: expected a number from 0 to 1"),
        ("inputs = 3\n" + SPEED, "inputs: expected a table"),
        ('[outputs]\n"TRUTH_MOTION.SPEED" = { noise = -1, fmu = "v" }\n', "noise: expected a number"),
        ('[outputs]\n"TRUTH_MOTION.SPEED" = 3\n', "expected a table"),
        ("[[", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    with pytest.raises(ScenarioError, match=words):
        load(tmp_path, text)


def test_no_such_file(tmp_path):
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_plant_map(tmp_path / "none.toml")

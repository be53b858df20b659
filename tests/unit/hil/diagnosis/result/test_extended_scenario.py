"""`run --extend`: the scenario file that every process reads has the effects and numbers of the extension."""

from pathlib import Path

import pytest

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.result.extended_scenario import effects_after_end, extended_scenario
from hil.diagnosis.vehicle.extension_file import load_extension
from hil.scenario.scenario import load_scenario
from plant.injection.theta import THETA

EXTENSION = """
[effects.imu_bias]
ax_mps2 = 0.3
[effects.tyre_radius]
gain = { rl = -0.01 }
[parameters]
vehicle_mass_kg = [1700.0]
friction_brake_piston_area_m2 = [0.0025, 0.0013]
"""


def _extension(folder: Path, text: str = EXTENSION) -> Path:
    path = folder / "extension.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["stop72", "town", "mu_split"])
def test_a_scenario_has_what_was_taught_and_all_it_had(tmp_path, name):
    plain, taught = load_scenario(name), load_scenario(str(extended_scenario(name, _extension(tmp_path), tmp_path)))
    assert taught.effects.theta[THETA.slice("tyre_radius", "gain")].tolist() == [0.0, 0.0, -0.01, 0.0]
    assert taught.effects.theta[THETA.slice("imu_bias", "ax_mps2")] == 0.3
    assert taught.plant.vehicle.mass_kg == 1700.0
    assert taught.plant.friction_brake.piston_area_m2 == (0.0025, 0.0013)
    assert taught.manoeuvre == plain.manoeuvre
    assert (taught.faults, taught.expectations) == (plain.faults, plain.expectations)


def test_an_extension_of_sensors_the_simulation_has_not_is_refused(tmp_path):
    with pytest.raises(UnusableError, match="nothing to simulate"):
        extended_scenario("stop72", _extension(tmp_path, "[channels.along]\ngain = -2.0\n"), tmp_path)


def test_a_number_no_car_has_is_refused(tmp_path):
    with pytest.raises(UnusableError, match="imu_bias"):
        extended_scenario("stop72", _extension(tmp_path, "[effects.imu_bias]\nax_mps2 = 50.0\n"), tmp_path)


ONSET = """
[effects.pad_mu_gain]
gain = { fl = -0.15, fr = -0.15 }
onset_log = "run3.csv"
onset_s = 2.5
"""


def test_an_effect_that_begins_in_a_log_begins_in_the_scenario_as_late(tmp_path):
    path = extended_scenario("stop72", _extension(tmp_path, ONSET), tmp_path)
    effects = load_scenario(str(path)).effects
    assert effects.number("pad_mu_gain", "onset_s").tolist() == [2.5]
    assert effects.number("pad_mu_gain", "gain").tolist() == [-0.15, -0.15, 0.0, 0.0]
    assert effects_after_end(path) == []


def test_an_effect_that_begins_after_the_scenario_is_named(tmp_path):
    path = extended_scenario("stop72", _extension(tmp_path, ONSET.replace("2.5", "250.0")), tmp_path)
    (remark,) = effects_after_end(path)
    assert "begins at 250 s" in remark
    assert "without it" in remark


def test_a_scale_of_an_earlier_file_is_read_as_the_gain_it_is(tmp_path):
    path = _extension(tmp_path, "[effects.wrong_scale]\nfactor = { imu = 0.5 }\n")
    assert load_extension(path).theta[THETA.slice("wrong_scale", "gain")].tolist() == [0.0, 0.5, 0.0, 0.0, 0.0]
    effects = load_scenario(str(extended_scenario("stop72", path, tmp_path))).effects
    assert effects.number("wrong_scale", "gain").tolist() == [0.0, 0.5, 0.0, 0.0, 0.0]

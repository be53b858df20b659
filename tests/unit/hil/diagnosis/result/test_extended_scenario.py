"""`run --extend`: the scenario file that every process reads has the effects and numbers of the extension."""

from pathlib import Path

import pytest

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.result.extended_scenario import extended_scenario
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

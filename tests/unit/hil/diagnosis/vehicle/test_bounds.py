"""Every key of a vehicle set has bounds that each road vehicle keeps and another unit leaves."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from outsider import VEHICLE

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.bounds import bounds_of, refuse_implausible
from hil.diagnosis.vehicle.keys import ALIASES, DERIVED, SPECIAL
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.validation.reference_car.files import vehicle_toml
from plant.vectors import PARAMETER

KEYS = sorted({*ALIASES.values(), *SPECIAL, *PARAMETER.sizes, *(name for name, _, _ in DERIVED.values())})
QUADRICYCLE = {
    "mass_kg": 450.0, "wheelbase_m": 1.69, "cog_to_front_axle_m": 0.95, "rolling_radius_m": 0.25,
    "brake_gain_front_nm_pa": 6e-5, "brake_gain_rear_nm_pa": 2e-5, "cog_height_m": 0.45, "frontal_area_m2": 1.2,
    "wheel_inertia_kg_m2": 0.25, "yaw_inertia_kg_m2": 220.0, "track_m": 1.09,
}  # fmt: skip
TRUCK = {
    "mass_kg": 40000.0, "wheelbase_m": 6.2, "cog_to_front_axle_m": 4.1, "rolling_radius_m": 0.5,
    "brake_gain_front_nm_pa": 1.8e-2, "brake_gain_rear_nm_pa": 1.8e-2, "cog_height_m": 1.9, "frontal_area_m2": 10.0,
    "wheel_inertia_kg_m2": 25.0, "yaw_inertia_kg_m2": 4e5, "track_m": 2.1, "steering_ratio": 22.0,
    "disc_heat_front_j_k": 20000.0, "threshold_pressure_pa": 3e4, "drag_coefficient": 0.7, "rolling_resistance": 0.006,
}  # fmt: skip


@pytest.mark.parametrize("name", KEYS)
def test_every_key_has_bounds_with_room_around_the_shipped_value(name: str) -> None:
    least, greatest, _ = bounds_of(name)
    assert np.isfinite([least, greatest]).all()
    if name in PARAMETER.sizes:
        values = paper_car().p[PARAMETER.slice(name)]
        assert (values >= least).all()
        assert (values <= greatest).all()


@pytest.mark.parametrize("car", [QUADRICYCLE, TRUCK, VEHICLE], ids=["quadricycle", "truck", "outsider"])
def test_small_and_large_vehicles_are_within(car: dict[str, float]) -> None:
    for key, value in car.items():
        name, _, factor = DERIVED.get(key, (ALIASES.get(key, key), None, 1.0))
        refuse_implausible("vehicle", key, name, value, factor)


def test_the_cars_that_come_with_brakebench_and_the_reference_car_are_within(tmp_path: Path) -> None:
    cars = resources.files("hil.diagnosis") / "cars"
    for name in ("av21", "toyota_rav4"):
        load_vehicle(Path(str(cars / f"{name}.vehicle.toml")))
    (tmp_path / "reference.toml").write_text(vehicle_toml())
    load_vehicle(tmp_path / "reference.toml")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("brake_gain_front_nm_pa", 26.0, r"expected 1e-06 to 0.1 N m/Pa.*got 26; N m/bar\? Write .* = 0.00026"),
        ("brake_gain_rear_nm_per_pa", 150.0, r"N m/MPa\? Write .* = 0.00015|N m/bar\? Write .* = 0.0015"),
        ("mass_kg", 1.65, r"t\? Write mass_kg = 1650"),
        ("wheelbase_m", 2720.0, r"mm\? Write wheelbase_m = 2.72"),
        ("rolling_radius_m", 31.8, r"cm\? Write rolling_radius_m = 0.318"),
        ("rolling_radius_m", 0.0, r"another unit"),
        ("ambient_k", 20.0, r"degC\? Write ambient_k = 293.15"),
        ("threshold_pressure_pa", -1.0, r"expected 0 to 3e\+06 Pa"),
        ("piston_area_m2", 25.5, r"cm2\? Write piston_area_m2 = 0.00255"),
        ("ehb_dead_time_s", 20.0, r"ms\? Write ehb_dead_time_s = 0.02"),
        ("motor_peak_power_w", 75.0, r"kW\? Write motor_peak_power_w = 75000"),
        ("suspension_ride_rate_n_m", [30.8, 29.9], r"N/mm\? Write .* = 30800"),
        ("front_weight_share", 54.0, r"%\? Write front_weight_share = 0.54"),
        ("tyre_friction", 100.0, r"tyre_friction: expected .* got 100"),
        ("mass_kg_tolerance", -5.0, r"expected a half-width of 0 or more"),
    ],
)  # fmt: skip
def test_a_value_that_no_vehicle_has_is_refused_with_the_one_to_write(key: str, value: object, message: str) -> None:
    with pytest.raises(UnusableError, match=message):
        load_vehicle({**VEHICLE, key: value})

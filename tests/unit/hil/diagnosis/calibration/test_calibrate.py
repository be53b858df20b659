"""``calibrate``: which keys get fitted values and tolerances, what stays, what is refused; that the set is usable."""

import json
import tomllib
from pathlib import Path

import numpy as np
import outsider
import pytest

from hil.cli.main import main
from hil.diagnosis.calibration.calibrate import refuse_impossible, with_numbers
from hil.diagnosis.calibration.fitted_set import Fit, fitted_numbers
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.key_names import indices_of, value_of
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.priors import recording_nuisances

TABLE = {
    **outsider.VEHICLE, "mass_kg_tolerance": 60.0, "note": "of somebody", "track_m": [1.5, 1.52],
    "wheel_inertia_kg_m2": 1.4, "threshold_pressure_pa": [4e4, 6e4], "threshold_pressure_pa_tolerance": 2e4,
}  # fmt: skip


def _fit(table: dict, moved: dict[str, float], sd: float = 0.3) -> tuple[Fit, object]:
    """A fit that moved some nuisances, by name, and learned nothing of the others."""
    car = load_vehicle(table)
    nuisances = (*car.nuisances, *recording_nuisances(False, car.latencies))
    names = [one.name for one in nuisances]
    z, deviations = np.zeros(len(nuisances)), np.ones(len(nuisances))
    for name, value in moved.items():
        z[names.index(name)], deviations[names.index(name)] = value, sd
    return Fit(nominal(car), nuisances, z, deviations), car


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"lift_front": 0.07, "slip_stiffness": 20.0, "ehb_dead_time_s": 0.03, "pad_gamma_front_k_w": 0.05},
        {"tyre_lkx": 0.9, "disc_heat_rear_j_k": 2500.0, "rolling_radius_m": 0.31, "steering_ratio": 15.0},
    ],
)
def test_every_key_reads_back_as_it_was_stated(more: dict) -> None:
    table = TABLE | more
    car = load_vehicle(table)
    read = {key: value_of(key, car.p) for key in table if indices_of(key)}
    assert len(read) == 8 + len(more.keys() - TABLE.keys())
    for key, value in read.items():
        assert value == pytest.approx(table[key]), key


@pytest.mark.parametrize("key", ["cog_to_rear_axle_m", "front_weight_share", "cog_x_m"])
def test_the_centre_of_gravity_by_any_key(key: str) -> None:
    value = {"cog_to_rear_axle_m": 1.42, "front_weight_share": 0.55, "cog_x_m": 1.3}[key]
    table = {k: v for k, v in TABLE.items() if k != "cog_to_front_axle_m"} | {key: value}
    fit, car = _fit(table, {"vehicle_cog_to_axle_m": 1.0})
    (number,), _ = fitted_numbers(fit, car, table)
    assert (number.key, number.before) == (key, pytest.approx(value))
    load_vehicle(with_numbers(table, [number]))


def test_what_was_fitted_moves_and_all_else_stays() -> None:
    fit, car = _fit(
        TABLE, {"vehicle_mass_kg": -1.0, "brake_gain_front": 2.0, "friction_brake_threshold_pressure_pa_rear": 1.0}
    )
    numbers, others = fitted_numbers(fit, car, TABLE)
    by_key = {one.key: one for one in numbers}
    assert set(by_key) == {"mass_kg", "brake_gain_front_nm_pa", "threshold_pressure_pa"}
    assert not others
    mass = by_key["mass_kg"]
    assert (mass.after, mass.moved) == (pytest.approx(1650.0 - 30.0, rel=1e-3), -0.5)
    assert (mass.tolerance_before, mass.tolerance_after) == (
        pytest.approx(60.0, rel=0.01),
        pytest.approx(18.0, rel=0.01),
    )
    assert (mass.unit, by_key["threshold_pressure_pa"].unit) == ("kg", "Pa")
    assert by_key["threshold_pressure_pa"].after == pytest.approx([4e4, 7e4], rel=0.01)
    new = with_numbers(TABLE | {"required": ["mass_kg"]}, numbers)
    kept = {key: value for key, value in TABLE.items() if key.removesuffix("_tolerance") not in by_key}
    assert kept.items() <= new.items()
    assert "required" not in new
    assert list(new)[:2] == ["mass_kg", "mass_kg_tolerance"]
    again = load_vehicle(new)
    moved = fit.at(fit.z).p
    assert np.allclose(again.p[:40], moved[:40], rtol=1e-5)
    assert again.remarks == load_vehicle(TABLE).remarks


def test_a_number_that_the_set_does_not_state_is_added_and_a_whole_section_is_not() -> None:
    fit, car = _fit(TABLE, {"vehicle_drag_coefficient": 1.0, "tyre_lkx": 2.0, "late_imu": 1.0, "ehb_dead_time_s": 1.0})
    numbers, others = fitted_numbers(fit, car, TABLE)
    assert {one.key: one.stated for one in numbers} == {"drag_coefficient": False, "imu_latency_s": False}
    assert others == ["tyre_lkx by +1.0 tolerances"]
    again = load_vehicle(with_numbers(TABLE, numbers))
    assert again.unstated == car.unstated
    assert again.latencies[0].value_s == pytest.approx(0.01)
    assert again.latencies[0].half_width_s == pytest.approx(0.006)


@pytest.mark.parametrize(("name", "z"), [("vehicle_mass_kg", -60.0), ("wheel_rolling_radius_m", 400.0)])
def test_a_number_that_no_car_has_is_refused(name: str, z: float) -> None:
    fit, car = _fit(TABLE, {name: z})
    numbers, _ = fitted_numbers(fit, car, TABLE)
    with pytest.raises(UnusableError, match="nothing is written: the fit leads to a number that no car has"):
        refuse_impossible(with_numbers(TABLE, numbers))


def _written(folder: Path, seed: int) -> list[str]:
    folder.mkdir()
    files = []
    for k, log in enumerate(outsider.logs(lambda v, p: np.ones(4), seed)[:2]):
        files.append(str(folder / f"{k}.csv"))
        np.savetxt(files[-1], np.column_stack(list(log.values())), "%.7g", ",", header=",".join(log), comments="")
    return files


def test_what_cannot_be_calibrated(tmp_path, capsys) -> None:
    (tmp_path / "set.toml").write_text("".join(f"{key} = {value!r}\n" for key, value in outsider.VEHICLE.items()))
    (tmp_path / "car.toml").write_text("")
    t = np.arange(0.0, 30.0, 0.01)
    v = 15.0 + 5.0 * np.sin(t)
    columns = [t, *[v / 0.318] * 4, 5.0 * np.cos(t)]
    head = f"t_s,{','.join(f'wheel_speed_{w}_rad_s' for w in outsider.WHEELS)},ax_mps2"
    np.savetxt(tmp_path / "a.csv", np.column_stack(columns), delimiter=",", header=head, comments="")
    words = ["calibrate", str(tmp_path / "a.csv"), "--vehicle", str(tmp_path / "set.toml"), "--out"]
    assert main([*words, str(tmp_path / "car.toml")]) == 2
    assert "not replaced" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "new.toml")]) == 2
    assert "a vehicle set is fitted by simulation" in capsys.readouterr().err
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_set_that_is_off_is_fitted_and_explains_another_day(tmp_path, capsys) -> None:
    reference, new = _written(tmp_path / "reference", 7), _written(tmp_path / "new", 1007)
    stated = outsider.VEHICLE | {
        "brake_gain_front_nm_pa": 2.6e-4, "brake_gain_front_nm_pa_tolerance": 0.4e-4,
        "brake_gain_rear_nm_pa_tolerance": 0.15e-4, "mass_kg_tolerance": 60.0,
    }  # fmt: skip
    (tmp_path / "set.toml").write_text("".join(f"{key} = {value!r}\n" for key, value in stated.items()))
    car = tmp_path / "car.toml"
    words = [*reference, "--vehicle", str(tmp_path / "set.toml"), "--out", str(car), "--json"]
    assert main(["calibrate", *words]) == 0
    said = json.loads(capsys.readouterr().out)
    gain = next(one for one in said["numbers"] if one["key"] == "brake_gain_front_nm_pa")
    assert gain["after"] == pytest.approx(2.9e-4, abs=2.0 * gain["tolerance_after"])
    assert gain["tolerance_after"] < 0.5 * gain["tolerance_before"]
    wheels = said["held_out_error"]["wheel.mean"]
    assert wheels["after"] < wheels["before"]
    written = tomllib.loads(car.read_text())
    assert written["wheelbase_m"] == 2.72
    assert written["brake_gain_front_nm_pa"] == pytest.approx(gain["after"], rel=1e-5)
    assert "held out" in car.read_text()
    assert main(["explain", *new, "--vehicle", str(car), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["causes"] == []
    assert answer["verdict"] in ("none", "not_testable")

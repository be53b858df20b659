"""Wrong units, signs and stamps are refused with what to write; faults of sensors and good logs go through."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from outsider import VEHICLE, drive

from hil.diagnosis.data.log import (
    MOTOR_DEMAND,
    MOTOR_TORQUE,
    PRESSURE,
    PRESSURE_DEMAND,
    WHEEL_SPEED,
    Log,
    UnusableError,
)
from hil.diagnosis.data.read import from_frame
from hil.diagnosis.data.trial.run import on_trial
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.trial_car import car_of

CAR = car_of(load_vehicle(VEHICLE))
RADIUS_M, G = VEHICLE["rolling_radius_m"], 9.80665
RPM, DEG = 30.0 / np.pi, 180.0 / np.pi
IMU = ("ax_mps2", "ay_mps2", "yaw_rate_rad_s")
Table = dict[str, np.ndarray]


@lru_cache
def _straight(kind: str = "mixed") -> Table:
    return drive(kind, 3, lambda v, p: np.ones(4))


@lru_cache
def _bend() -> Table:
    """A slalom at 15 m/s with a stop of the turning in between, and noise."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20.0, 0.01)
    yaw = 0.3 * np.sin(1.3 * t) * (t > 3.0) + 0.1 * np.sin(2.9 * t)
    speed = 15.0 + np.sin(0.4 * t)
    half = 0.5 * CAR.track_m * yaw
    wheels = [(speed + side * half) / RADIUS_M + 0.05 * rng.standard_normal(len(t)) for side in (-1, 1, -1, 1)]
    noisy = {
        "yaw_rate_rad_s": yaw + 0.003 * rng.standard_normal(len(t)),
        "ay_mps2": yaw * speed + 0.05 * rng.standard_normal(len(t)),
        "steer_rad": yaw * CAR.steering_m / speed * (1.0 + 0.002 * speed**2) + 0.002 * rng.standard_normal(len(t)),
    }
    return {"t_s": t, **dict(zip(WHEEL_SPEED, wheels, strict=True)), **noisy}


def _log(table: Table, name: str = "run3.csv") -> Log:
    return from_frame(table, name)


def _times(table: Table, names: tuple[str, ...] | str, factor: float) -> Table:
    names = (names,) if isinstance(names, str) else names
    return table | {name: factor * table[name] for name in names}


def _late(table: Table, names: tuple[str, ...], by_s: float) -> Table:
    t = table["t_s"]
    return table | {name: np.interp(t - by_s, t, table[name]) for name in names}


def _without(table: Table, *names: str) -> Table:
    return {name: values for name, values in table.items() if name not in names}


@pytest.mark.parametrize("kind", ["stops", "mixed", "motors", "coast"])
def test_a_good_log_goes_through_as_it_is(kind: str) -> None:
    log = _log(_straight(kind))
    (passed,) = on_trial([log], CAR)
    assert passed.remarks == log.remarks
    assert all(passed.channels[name] is log.channels[name] for name in log.channels)


def test_a_good_slalom_goes_through() -> None:
    (passed,) = on_trial([_log(_bend())], CAR)
    assert not passed.remarks
    lags = {one.channel: one.lag_s for one in passed.read}
    assert abs(lags["yaw_rate_rad_s"]) < 0.02


ALONG: list[tuple[str, tuple[str, ...] | str, float, str]] = [
    ("a ground speed in km/h", "speed_mps", 3.6, r"run3.csv: speed_mps is 3\.\d+ times .*`speed_mps \[km/h\]`"),
    ("a ground speed in mph", "speed_mps", 2.23694, r"`speed_mps \[mph\]`"),
    ("wheel speeds in rpm", WHEEL_SPEED, RPM, r"rpm\? Write `wheel_speed_fl_rad_s \[rpm\]`"),
    ("wheel speeds in rev/s", WHEEL_SPEED, 0.5 / np.pi, r"\[rev/s\]"),
    ("wheel speeds in deg/s", WHEEL_SPEED, DEG, r"\[deg/s\]|wrong unit"),
    ("wheel speeds in m/s", WHEEL_SPEED, RADIUS_M, r"speed of the road in m/s.*scale = 3\.1447"),
    ("wheel speeds in km/h", WHEEL_SPEED, 3.6 * RADIUS_M, r"speed of the road in km/h.*scale = 3\.1447"),
    ("one wheel in rpm", WHEEL_SPEED[2], RPM, r"_rl_rad_s read 9\.\d+ times .*`wheel_speed_rl_rad_s \[rpm\]`"),
    ("an axle in rpm", WHEEL_SPEED[:2], RPM, r"wheel_speed_fl_rad_s, wheel_speed_fr_rad_s read 9"),
    ("ax in g", "ax_mps2", 1.0 / G, r"ax_mps2 is 0\.\d+ times the wheels' acceleration .*`ax_mps2 \[g\]`"),
    ("ax turned", "ax_mps2", -1.0, r"ax_mps2 is -\d.*sign = -1 under \[ax_mps2\]"),
    ("ax in g and turned", "ax_mps2", -1.0 / G, r"\[g\]`.* its sign is turned"),
    ("pressures in bar", PRESSURE + PRESSURE_DEMAND, 1e-5, r"`pressure_fl_pa \[bar\]`"),
    ("pressures in kPa", PRESSURE + PRESSURE_DEMAND, 1e-3, r"\[kPa\]"),
    ("measured pressures in bar", PRESSURE, 1e-5, r"`pressure_fl_pa \[bar\]`"),
    ("demanded pressures in MPa", PRESSURE_DEMAND, 1e-6, r"`pressure_demand_fl_pa \[MPa\]`"),
    ("one pressure in bar", PRESSURE[3], 1e-5, r"pressure_rr_pa read .*`pressure_rr_pa \[bar\]`"),
    ("torques in kN m", MOTOR_TORQUE + MOTOR_DEMAND, 1e-3, r"`motor_torque_fl_nm \[kN m\]`"),
    ("demanded torques in kN m", MOTOR_DEMAND, 1e-3, r"`motor_torque_demand_fl_nm \[kN m\]`"),
    ("torques turned", MOTOR_TORQUE + MOTOR_DEMAND, -1.0, r"against .*sign = -1 under \[motor_torque_fl_nm\]"),
    ("measured torques turned", MOTOR_TORQUE, -1.0, r"opposite signs"),
]  # fmt: skip


@lru_cache
def _slow() -> Table:
    """As mixed, at two fifths of its speed: even rpm stay within what a wheel may read."""
    table = _straight()
    return _times(table, (*WHEEL_SPEED, "speed_mps", "ax_mps2", *PRESSURE, *MOTOR_TORQUE), 0.4) | {
        name: 0.4 * table[name] for name in PRESSURE_DEMAND + MOTOR_DEMAND
    }


@pytest.mark.parametrize(("names", "factor", "message"), [row[1:] for row in ALONG], ids=[row[0] for row in ALONG])
def test_a_wrong_unit_or_sign_along_the_car_is_refused(
    names: tuple[str, ...] | str, factor: float, message: str
) -> None:
    with pytest.raises(UnusableError, match=message):
        on_trial([_log(_times(_slow(), names, factor))], CAR)


@pytest.mark.parametrize(
    ("names", "factor", "message"),
    [
        ("ax_mps2", 1.0 / G, r"\[g\]"), (WHEEL_SPEED, RPM, r"\[rpm\]"), (WHEEL_SPEED, 0.5 / np.pi, r"\[rev/s\]"),
        ("ax_mps2", -1.0, "sign = -1"),
    ],
)  # fmt: skip
def test_without_a_ground_speed_rpm_and_g_are_kept_from_each_other(
    names: tuple[str, ...] | str, factor: float, message: str
) -> None:
    """Wheels in rpm and an accelerometer in g give nearly the same factor, 9.55 and 9.81."""
    with pytest.raises(UnusableError, match=message):
        on_trial([_log(_without(_times(_slow(), names, factor), "speed_mps"))], CAR)


def test_a_speed_alone_in_kmh_is_seen_by_the_accelerometer() -> None:
    table = _without(_times(_straight(), "speed_mps", 3.6), *WHEEL_SPEED)
    with pytest.raises(UnusableError, match=r"speed_mps \[km/h\]"):
        on_trial([_log(table)], CAR)


@pytest.mark.parametrize(
    ("names", "factor", "message"),
    [
        ("yaw_rate_rad_s", DEG, r"wrong unit\?.*deg/s|yaw_rate_rad_s \[deg/s\]"),
        ("yaw_rate_rad_s", -1.0, r"sign = -1 under \[yaw_rate_rad_s\]"),
        ("ay_mps2", 1.0 / G, r"ay_mps2 \[g\]"), ("ay_mps2", -1.0, r"sign = -1 under \[ay_mps2\]"),
        ("steer_rad", DEG, r"steer_rad \[deg\]|steer_rad.*wrong unit"),
        ("steer_rad", -1.0, r"sign = -1 under \[steer_rad\]"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("share", [1.0, 0.15])
def test_a_wrong_unit_or_sign_across_the_car_is_refused(names: str, factor: float, message: str, share: float) -> None:
    """The smaller slalom stays within what channels may read even in a wrong unit."""
    table = _bend()
    half = 0.5 * (1.0 - share)
    left, right = WHEEL_SPEED[::2], WHEEL_SPEED[1::2]
    table = _times(table, (*IMU[1:], "steer_rad"), share)
    mean = {(a, b): (table[a], table[b]) for a, b in zip(left, right, strict=True)}
    for (a, b), (x, y) in mean.items():
        table = table | {a: x + half * (y - x), b: y - half * (y - x)}
    with pytest.raises(UnusableError, match=message):
        on_trial([_log(_times(table, names, factor))], CAR)


def test_left_and_right_wheels_exchanged_are_seen() -> None:
    table = _bend()
    swapped = {WHEEL_SPEED[k]: table[WHEEL_SPEED[j]] for k, j in enumerate((1, 0, 3, 2))}
    with pytest.raises(UnusableError, match="left and right exchanged"):
        on_trial([_log(table | swapped)], CAR)


def test_yaw_rate_against_the_lateral_acceleration_alone_names_both() -> None:
    table = _times(_without(_bend(), *WHEEL_SPEED, "steer_rad"), "yaw_rate_rad_s", -1.0)
    with pytest.raises(
        UnusableError, match=r"nothing else shows which.*yaw_rate_rad_s.*ay_mps2|ay_mps2.*yaw_rate_rad_s"
    ):
        on_trial([_log(table | {"speed_mps": 15.0 + np.sin(0.4 * table["t_s"])})], CAR)


def test_several_logs_with_one_fault_are_one_line() -> None:
    logs = [_log(_times(_straight(kind), "speed_mps", 3.6), f"run{k}.csv") for k, kind in enumerate(("stops", "mixed"))]
    with pytest.raises(UnusableError) as refused:
        on_trial(logs, CAR)
    assert str(refused.value).count("\n") == 0
    assert str(refused.value).startswith("run0.csv (and 1 more log): speed_mps is 3.")


FAULTS: list[tuple[str, Callable[[Table], Table]]] = [
    ("ax 6 % off", lambda table: _times(table, "ax_mps2", 1.06)),
    ("ax 15 % off", lambda table: _times(table, "ax_mps2", 0.85)),
    ("wheels 5 % small", lambda table: _times(table, WHEEL_SPEED, 1.05)),
    ("one wheel 3 % small", lambda table: _times(table, WHEEL_SPEED[1], 1.03)),
    ("ground speed 8 % off", lambda table: _times(table, "speed_mps", 0.92)),
    ("pressures 30 % off", lambda table: _times(table, PRESSURE, 1.3)),
    ("torques 20 % off", lambda table: _times(table, MOTOR_TORQUE, 0.8)),
    ("imu 0.1 s late", lambda table: _late(table, IMU, 0.1)),
    ("wheels 0.1 s late", lambda table: _late(table, WHEEL_SPEED, 0.1)),
    ("a wheel that stands still", lambda table: _times(table, WHEEL_SPEED[0], 0.0)),
    ("a pressure stuck at zero", lambda table: _times(table, PRESSURE[0], 0.0)),
]


@pytest.mark.parametrize("fault", [row[1] for row in FAULTS], ids=[row[0] for row in FAULTS])
@pytest.mark.parametrize("kind", ["stops", "mixed"])
def test_a_fault_of_a_sensor_goes_through_to_the_diagnosis(fault: Callable[[Table], Table], kind: str) -> None:
    log = _log(fault(_straight(kind)))
    (passed,) = on_trial([log], CAR)
    assert passed.remarks == log.remarks
    assert all(passed.channels[name] is log.channels[name] for name in log.channels)


@pytest.mark.parametrize("by_s", [0.9, 0.4, -0.6])
@pytest.mark.parametrize("names", [("speed_mps",), IMU, WHEEL_SPEED, PRESSURE], ids=lambda names: names[0])
def test_a_message_far_too_late_is_moved_and_named(names: tuple[str, ...], by_s: float) -> None:
    """Of a speed message 0.9 s late beside an accelerometer, ground speed and wheels show which one it is."""
    table = _straight("stops")
    (passed,) = on_trial([_log(_late(table, names, by_s))], CAR)
    (remark,) = [text for text in passed.remarks if "which agree" in text]
    assert remark.startswith(names[0])
    assert ("late" if by_s > 0.0 else "early") in remark
    inside = np.isfinite(passed.channels[names[0]])
    true = table[names[0]]
    assert inside.mean() > 0.9
    assert np.std(passed.channels[names[0]][inside] - true[inside]) < 0.1 * np.std(true)
    lags = {one.channel: one.lag_s for one in passed.read}
    if names != WHEEL_SPEED:
        assert lags[names[0]] == pytest.approx(by_s, abs=0.15)


def test_a_sparse_ground_speed_far_too_late_keeps_its_samples() -> None:
    table = _late(_straight("stops"), ("speed_mps",), 0.9)
    table["speed_mps"] = np.where(np.arange(len(table["t_s"])) % 10 == 0, table["speed_mps"], np.nan)
    (passed,) = on_trial([_log(table)], CAR)
    finite = np.isfinite(passed.channels["speed_mps"])
    assert 0.08 < finite.mean() < 0.11
    assert np.std(passed.channels["speed_mps"][finite] - _straight("stops")["speed_mps"][finite]) < 0.2


def test_two_channels_that_contradict_each_other_are_refused_with_what_to_do() -> None:
    table = _late(_without(_straight("stops"), "speed_mps", *PRESSURE, *MOTOR_TORQUE), ("ax_mps2",), 0.9)
    with pytest.raises(UnusableError, match=r"ax_mps2 .* 0\.\d+ s later than the wheel speeds.*nothing else shows"):
        on_trial([_log(table)], CAR)


def test_where_sensors_are_compared_with_the_motion_their_scale_is_a_cause_and_a_remark() -> None:
    log = _log(_times(_straight("stops"), "ax_mps2", -1.0))
    (passed,) = on_trial([log], CAR, simulated=False)
    assert any("sign = -1 under [ax_mps2]" in text for text in passed.remarks)
    with pytest.raises(UnusableError, match="km/h"):
        on_trial([_log(_times(_straight("stops"), "speed_mps", 3.6))], CAR, simulated=False)


def test_torques_of_motors_before_a_gear_are_remarked_on() -> None:
    (passed,) = on_trial([_log(_times(_straight("motors"), MOTOR_TORQUE + MOTOR_DEMAND, 1.0 / 9.0))], CAR)
    assert any("behind a gear give its ratio" in text for text in passed.remarks)


def test_an_accelerometer_and_pressures_in_wrong_units_are_told_at_once() -> None:
    table = _times(_times(_straight(), "ax_mps2", 1.0 / G), PRESSURE + PRESSURE_DEMAND, 1e-5)
    with pytest.raises(UnusableError, match=r"ax_mps2 \[g\](.|\n)*pressure_fl_pa \[bar\]"):
        on_trial([_log(table)], CAR)

"""The car `dead_time`: its physics against known limits, its logs, its papers."""

import numpy as np
import pytest

from hil.validation.strangers.car import Hidden, Tolerated
from hil.validation.strangers.dead_time import DeadTime
from hil.validation.strangers.dead_time.car import CHANGES, SIX, STATED
from hil.validation.strangers.dead_time.log import GAIN_FRONT, GAIN_REAR, RADIUS_M
from hil.validation.strangers.dead_time.motion import G_MPS2, STEP_S, Corners, Motion, Numbers, move

CAR = DeadTime()
FREE = Numbers(drag_coefficient=0.0, rolling_resistance=0.0, lift_front=0.0, lift_rear=0.0)
EVEN = Corners(np.full(4, RADIUS_M), np.repeat([GAIN_FRONT, GAIN_REAR], 2), np.zeros(4), np.ones(4))


@pytest.fixture(scope="module")
def clean():
    """A drive without noise."""
    return CAR.drive(4, noisy=False)


def _moved(car=FREE, seconds=4.0, pressure=0.0, torque=0.0, steer=0.0, speed=20.0, slope=0.0, corners=EVEN):
    n = round(seconds / STEP_S)
    wheels = np.ones((n, 4))
    return Motion(
        *move(
            car, corners, pressure * wheels, torque * wheels, np.full(n, steer), np.zeros(n), np.full(n, slope), speed,
            350.0,
        )
    )  # fmt: skip


def _turning_kg(car):
    """Mass of the body with what its wheels add, kg."""
    return car.mass_kg + 4.0 * car.wheel_inertia_kg_m2 / RADIUS_M**2


def test_nothing_acts_and_nothing_changes() -> None:
    moved = _moved()
    assert moved.speed_mps == pytest.approx(20.0, abs=1e-9)
    assert moved.omega_rad_s * RADIUS_M == pytest.approx(20.0, abs=1e-9)


@pytest.mark.parametrize("pressure", [1e6, 3e6])
def test_steady_deceleration_is_the_sum_of_torques_over_radius_and_mass(pressure) -> None:
    moved = _moved(pressure=pressure, speed=25.0, seconds=3.0)
    expected = 2.0 * (GAIN_FRONT + GAIN_REAR) * (pressure - FREE.threshold_pressure_pa) / RADIUS_M / _turning_kg(FREE)
    slowed = -np.diff(moved.speed_mps[1000:2500]) / STEP_S
    assert np.mean(slowed) == pytest.approx(expected, rel=0.01)
    assert np.ptp(slowed) < 0.02 * expected  # alike down to low speed, however stiff the tyres are there


def test_energy_taken_by_motors_is_that_of_motion_and_slip() -> None:
    moved = _moved(torque=-200.0, seconds=6.0)
    taken = np.sum(moved.torque_nm * moved.omega_rad_s) * STEP_S
    at = [0.5 * FREE.mass_kg * moved.speed_mps[k] ** 2 for k in (0, -1)]
    at = [
        e + 0.5 * FREE.wheel_inertia_kg_m2 * np.sum(moved.omega_rad_s[k] ** 2) for e, k in zip(at, (0, -1), strict=True)
    ]
    slip = -moved.torque_nm.sum(axis=1) / RADIUS_M * (moved.speed_mps - moved.omega_rad_s.mean(axis=1) * RADIUS_M)
    assert at[1] - at[0] == pytest.approx(taken - np.sum(slip) * STEP_S, rel=0.003)


def test_loads_carry_the_weight_and_move_forward_under_braking() -> None:
    moved = _moved(pressure=3e6, seconds=2.0)
    assert moved.load_n.sum(axis=1) == pytest.approx(FREE.mass_kg * G_MPS2, rel=1e-9)
    front = moved.load_n[-1, :2].sum() - moved.load_n[0, :2].sum()
    assert front == pytest.approx(-FREE.mass_kg * FREE.cog_height_m * moved.force_mps2[-1] / FREE.wheelbase_m, rel=0.02)


def test_a_steady_bend_is_that_of_the_linear_single_track_car() -> None:
    """Rajamani, Vehicle Dynamics and Control, 3.1: r = v delta / (L + K v^2), K = m/L (b/C_f - a/C_r)."""
    car = FREE._replace(roll_share_front=0.5, friction_by_load=0.0, tyre_friction=1e6)
    steer, speed = 0.1, 15.0
    moved = _moved(car, steer=steer, speed=speed, seconds=4.0)
    front, rear = car.cog_to_front_axle_m, car.wheelbase_m - car.cog_to_front_axle_m
    stiff = car.cornering_stiffness * car.mass_kg * G_MPS2 / car.wheelbase_m
    gradient = car.mass_kg / car.wheelbase_m * (rear / (stiff * rear) - front / (stiff * front))
    v = moved.speed_mps[-1]
    expected = v * steer / car.steering_ratio / (car.wheelbase_m + gradient * v**2)
    assert moved.yaw_rate_rad_s[-1] == pytest.approx(expected, rel=0.01)


def test_no_wheel_brakes_more_than_its_tyre_holds() -> None:
    """Locked, mu g; here without change of the friction by load."""
    car = FREE._replace(friction_by_load=0.0)
    moved = _moved(car, pressure=3e7, seconds=2.0, speed=30.0)
    assert moved.omega_rad_s[-1] == pytest.approx(np.zeros(4))
    assert moved.force_mps2[-1] == pytest.approx(-car.tyre_friction * G_MPS2, rel=1e-3)


def test_motor_and_hydraulics_answer_after_their_dead_times() -> None:
    n = 400
    step = np.where(np.arange(n) < 100, 0.0, 1.0)[:, None] * np.ones(4)
    zero = np.zeros(n)
    moved = Motion(*move(FREE, EVEN, 1e5 * step, 100.0 * step, zero, zero, zero, 20.0, 350.0))
    torque, pressure = moved.torque_nm[:, 0], moved.pressure_pa[:, 0]
    assert np.argmax(torque > 0.0) == 100 + round(FREE.motor_dead_time_s / STEP_S)
    assert np.argmax(pressure > 0.0) == 100 + round(FREE.ehb_dead_time_s / STEP_S)
    late = np.argmax(torque > 100.0 * (1.0 - np.exp(-1.0))) - np.argmax(torque > 0.0)
    assert late * STEP_S == pytest.approx(FREE.motor_lag_s, abs=2 * STEP_S)


def test_a_car_at_rest_on_a_slope_feels_it() -> None:
    moved = _moved(pressure=4e6, speed=3.0, slope=0.2, seconds=2.0)
    assert (moved.speed_mps[-1], moved.force_mps2[-1]) == (0.0, pytest.approx(0.2))


def test_a_drive_is_six_logs_of_two_minutes_that_follow_from_the_seed() -> None:
    one, again, other = CAR.drive(4), CAR.drive(4), CAR.drive(5)
    assert len(one) == 6
    assert 90.0 < sum(table["t_s"][-1] for table in one) < 130.0
    for a, b, c in zip(one, again, other, strict=True):
        assert all(np.array_equal(a[name], b[name]) for name in a)
        assert not np.array_equal(a["ax_mps2"][:500], c["ax_mps2"][:500])
        assert all(np.isfinite(values).all() for values in a.values())


def test_noise_is_what_the_car_says(clean) -> None:
    noisy, noise = CAR.drive(4), CAR.noise(4)
    for name, size in noise.white.items():
        apart = noisy[3][name] - clean[3][name]
        assert np.std(np.diff(apart)) / 2**0.5 == pytest.approx(size, rel=0.08)


@pytest.mark.parametrize("name", CAR.causes)
def test_every_cause_changes_logs_but_no_demand(name, clean) -> None:
    cause = CAR.causes[name]
    hidden = CAR.drive(4, Hidden(name, cause.largest), noisy=False)
    apart = False
    for one, other in zip(hidden, clean, strict=True):
        rows = min(len(one["t_s"]), len(other["t_s"]))
        same = {key: np.array_equal(one[key][:rows], other[key][:rows]) for key in one}
        assert all(same[key] for key in same if "demand" in key or key == "steer_rad")
        apart = apart or not all(same.values())
    assert apart
    assert set(CHANGES) == set(CAR.causes)


def test_what_the_owner_states_holds() -> None:
    lengths = []
    for k in range(30):
        said = CAR.stated(np.random.default_rng(k))
        keys = [key for key in said if not key.endswith("_tolerance")]
        lengths.append(len(keys))
        assert set(keys) == set(SIX if len(keys) == 6 else STATED)
        true = CAR.stated(_Certain())
        for key in keys:
            half = said.get(f"{key}_tolerance", 0.01 * true[key])
            assert abs(said[key] - true[key]) <= half * 1.002  # five digits
    assert {6, len(STATED)} == set(lengths)


class _Certain:
    """Draws nothing off, and the long set."""

    def random(self):
        return 1.0

    def standard_normal(self):
        return 0.0


@pytest.mark.slow
def test_every_tolerated_number_changes_logs(clean) -> None:
    for number in CAR.tolerated(CAR.stated(np.random.default_rng(0))):
        off = CAR.drive(4, noisy=False, off=Tolerated(number.name, 3.0 * number.deviation))
        assert any(
            len(a["t_s"]) != len(b["t_s"]) or any(not np.array_equal(a[name], b[name]) for name in a)
            for a, b in zip(off, clean, strict=True)
        ), number.name

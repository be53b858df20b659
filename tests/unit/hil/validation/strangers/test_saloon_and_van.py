"""Two strangers' cars: their drives obey mechanics, follow from the seed, and can be read."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hil.diagnosis.data.read import from_frame
from hil.diagnosis.vehicle.load import load_vehicle
from hil.validation.strangers.brake_by_wire_van import BrakeByWireVan, van
from hil.validation.strangers.brake_by_wire_van import course as van_course
from hil.validation.strangers.brake_by_wire_van import motion as van_motion
from hil.validation.strangers.car import Hidden
from hil.validation.strangers.hydraulic_saloon import HydraulicSaloon, saloon
from hil.validation.strangers.hydraulic_saloon import course as saloon_course
from hil.validation.strangers.hydraulic_saloon import motion as saloon_motion
from hil.validation.strangers.hydraulic_saloon.brakes import drum_factor

CARS = [HydraulicSaloon(), BrakeByWireVan()]
ids = pytest.mark.parametrize("car", CARS, ids=lambda car: car.name)
FLAT = np.zeros((3, 1))


@cache
def _noisy(car):
    return car.drive(5)


def _still(count: int) -> np.ndarray:
    return np.zeros(count)


def _saloon_run(foot_n: float, seconds: float, speed: float = 25.0):
    car, _ = saloon.truth(3)
    count = round(seconds / saloon_motion.STEP_S)
    course = saloon_course.Course(
        speed, np.full(count, foot_n), _still(count), _still(count), _still(count), FLAT, np.full(4, 350.0)
    )
    return car, saloon.motion(car, course)


def _van_run(asked_nm: float, seconds: float, speed: float = 20.0):
    numbers, _ = van.truth(3)
    count = round(seconds / van_motion.ROW_S)
    course = van_course.Course(speed, np.full(count, asked_nm), _still(count), _still(count), _still(count), FLAT)
    return numbers, van.motion(numbers, course)


def test_the_saloon_decelerates_by_its_torques_over_its_mass():
    car, rows = _saloon_run(150.0, 2.0)
    row = rows[1500]
    v, p = row[saloon_motion.VX], row[saloon_motion.PRESSURE : saloon_motion.PRESSURE + 4]
    mu = car.mu * (1.0 - car.pad_speed_loss * v / 30.0)
    factor = np.array([2.0 * mu[0], 2.0 * mu[1], drum_factor(mu[2]), drum_factor(mu[3])])
    torque = factor * (p - car.threshold_pa) * car.piston_m2 * car.efficiency * car.radius_brake_m
    turning = (
        row[saloon_motion.OMEGA : saloon_motion.OMEGA + 4] - rows[1400, saloon_motion.OMEGA : saloon_motion.OMEGA + 4]
    ) / 0.1
    drag = car.drag_nm + np.array([1.0, 1.0, 0.0, 0.0]) * (car.gearbox_nm + car.gearbox_nms * v / 0.3045)
    wheels = np.sum((torque + drag + car.wheel_inertia_kg_m2 * turning) / car.radius_m)
    expected = -(wheels + car.rolling[0] * car.mass_kg * 9.81 + car.drag_kg_m * v * v) / car.mass_kg
    assert row[saloon_motion.AX] == pytest.approx(expected, rel=2e-3)


def test_the_van_turns_its_energy_into_heat_and_charge():
    car, rows = _van_run(-4000.0, 2.5)
    h, w = van_motion.ROW_S, slice(van_motion.OMEGA, van_motion.OMEGA + 4)

    def energy(row: np.ndarray) -> float:
        mean = row[van_motion.OMEGA + 2 : van_motion.OMEGA + 4].mean()
        turning = np.sum(car.wheel_inertia_kg_m2 * row[w] ** 2) + car.rotor_kg_m2 * mean**2
        return 0.5 * (car.mass_kg * row[van_motion.VX] ** 2 + turning)

    v, omega = rows[:, van_motion.VX], rows[:, w]
    clamp = rows[:, van_motion.CLAMP : van_motion.CLAMP + 4]
    torque = car.gain_nm_pa * (1.0 - car.pad_speed_loss * v[:, None] / 30.0) * np.maximum(clamp - car.threshold_pa, 0.0)
    rest = car.drag_nm + car.rolling * car.mass_kg * 9.81 / 4.0 * car.radius_m
    brakes = np.sum((torque + rest) * omega, axis=1)
    motor = -car.motor_gain * rows[:, van_motion.MOTOR] * omega[:, 2:].mean(axis=1)
    force = rows[:, van_motion.ALONG : van_motion.ALONG + 4]
    slip = np.sum(force * (omega * car.radius_m - v[:, None]), axis=1)
    spent = np.trapezoid(brakes + motor + slip + car.drag_kg_m * v**3, dx=h)
    assert energy(rows[0]) - energy(rows[-1]) == pytest.approx(spent, rel=2e-3)


def test_steps_of_the_saloon_agree_with_an_adaptive_integrator():
    car, rows = _saloon_run(200.0, 0.6)
    d = np.zeros(saloon_motion.STATES)

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        saloon_motion.derivative(y, d, car, 200.0, 0.0, 0.0, 0.0, 0.0)
        return d.copy()

    found = solve_ivp(slope, (0.0, 0.599), rows[0, : saloon_motion.STATES], rtol=1e-9, atol=1e-9)
    assert found.y[:, -1] == pytest.approx(rows[-1, : saloon_motion.STATES], rel=1e-4, abs=1e-5)


def test_steps_of_the_van_agree_with_an_adaptive_integrator():
    numbers, _ = van.truth(3)
    start = np.zeros(van_motion.STATES)
    start[van_motion.VX] = 15.0
    # wheels that turn too slowly, clamped: all of it has to settle
    start[van_motion.OMEGA : van_motion.OMEGA + 4] = 14.7 / numbers.radius_m
    start[van_motion.CLAMP : van_motion.CLAMP + 4] = 3e6
    zeros = _still(600)
    rows = van_motion.run(start, numbers, zeros, zeros, zeros, zeros, FLAT, van.CONTROL, van.NONE, 1.0)
    d = np.zeros(van_motion.STATES)

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        van_motion.derivative(y, d, numbers, np.zeros(4), 0.0, 0.0, 0.0, 0.0, 0.0)
        return d.copy()

    found = solve_ivp(slope, (0.0, 0.599), start, rtol=1e-9, atol=1e-9)
    scale = np.abs(rows[:, : van_motion.STATES]).max(axis=0)
    assert np.all(np.abs(found.y[:, -1] - rows[-1, : van_motion.STATES]) <= 1e-4 * scale + 1e-5)


@ids
def test_a_drive_follows_from_its_seed(car):
    first, again = _noisy(car), car.drive(5)
    assert 4 <= len(first) <= 6
    assert 90.0 <= sum(log["t_s"][-1] for log in first) <= 130.0
    for one, two in zip(first, again, strict=True):
        assert all(np.array_equal(one[name], two[name]) for name in one)
    assert not np.array_equal(first[0]["ax_mps2"][:100], first[1]["ax_mps2"][:100])


@ids
def test_noise_is_what_is_told(car):
    noisy, clean, told = _noisy(car), car.drive(5, noisy=False), car.noise(5)
    # the first second: all move, no wheel is counted tooth by tooth
    rows = {name: np.concatenate([a[name][:50] - b[name][:50] for a, b in zip(noisy, clean, strict=True)])
            for name in noisy[0]}  # fmt: skip
    exact = {name for name in rows if "demand" in name or name in ("t_s", "pedal", "throttle")}
    assert set(told.white) == set(rows) - exact
    for name, white in told.white.items():
        expected = np.hypot(white, told.coloured.get(name, (0.0, 1.0))[0])
        assert 0.4 * expected < rows[name].std() < 2.0 * expected, name


@ids
def test_logs_and_sets_are_read(car):
    for log in _noisy(car):
        read = from_frame(log)
        assert set(read.channels) == set(log) - {"t_s"}
        assert not read.remarks
    for seed in range(6):
        vehicle = load_vehicle(car.stated(np.random.default_rng(seed)))
        assert not [remark for remark in vehicle.remarks if "unknown" in remark]


@ids
@pytest.mark.slow
def test_every_cause_shows_in_the_logs(car):
    clean = car.drive(5, noisy=False)
    for cause in car.causes.values():
        hidden = Hidden(cause.name, cause.smallest)
        shown = 0.0
        for one, two in zip(clean, car.drive(5, hidden, noisy=False), strict=True):
            count = min(len(one["t_s"]), len(two["t_s"]))
            shown += sum(
                float(np.sum(((one[name][:count] - two[name][:count]) / sd) ** 2))
                for name, sd in car.noise(5).white.items() if sd > 0.0
            )  # fmt: skip
            assert all(np.isfinite(column).all() for column in two.values()), cause.name
        assert shown**0.5 > 3.0, cause.name


@ids
@pytest.mark.slow
def test_every_tolerated_number_changes_something(car):
    clean = car.drive(5, noisy=False)
    for number in car.tolerated({}):
        off = car.drive(5, noisy=False, off=number)
        assert any(
            not np.array_equal(one[name][: len(two[name])], two[name][: len(one[name])])
            for one, two in zip(clean, off, strict=True)
            for name in one
        ), number.name

"""Against a small car of the test's own: one speed, four wheels in steady slip, forces from eq. (16)."""

import math

import numpy as np
import pytest

from ecu.law.estimator import joint_parameters
from ecu.law.joint import layout as joint
from ecu.law.joint.filter import joint_step
from ecu.law.joint.motion import median_wheel

DT, RADIUS, INERTIA, MASS = 0.01, 0.308, 1.5, 1463.0
FRICTION = slice(joint.FRICTION, joint.FRICTION + 4)
TORQUE = slice(joint.TORQUE, joint.TORQUE + 4)


def gains():
    return np.array([2 * 0.108 * 25.5e-4, 2 * 0.108 * 25.5e-4, 2 * 0.103 * 11.3e-4, 2 * 0.103 * 11.3e-4]) * 0.97


class SmallCar:
    """Free rolling, then braked by pressures and motor torques; sensors with noise, offsets and the body's dive."""

    def __init__(self, parameters, seed=0, mu=(0.38,) * 4, mass=MASS, bias=0.0, grade=0.0, zero_pa=0.0):
        self.p = joint_parameters(parameters)
        self.rng = np.random.default_rng(seed)
        self.mu, self.mass, self.bias, self.grade, self.zero_pa = np.array(mu), mass, bias, grade, zero_pa
        self.v, self.pitch, self.pitch_rate = 20.0, 0.0, 0.0
        self.state = np.zeros(joint.SIZE)
        self.true_torque = np.zeros(4)

    def run(self, seconds, pressure_pa=0.0, motor_nm=0.0, demand=0.0, noise=1.0):
        for _ in range(round(seconds / DT)):
            clamp = max(pressure_pa - 0.5e5, 0.0)
            torque = motor_nm - self.mu * gains() * clamp
            drag = 0.5 * 1.205 * 0.645 * self.v**2 + self.mass * 9.80665 * 0.011
            turn = 4 * INERTIA / RADIUS**2
            a = (torque.sum() / RADIUS - drag - self.mass * 9.80665 * self.grade) / (self.mass + turn)
            felt = a + 9.80665 * self.grade
            self.v += a * DT
            w = 2 * math.pi * 1.4
            self.pitch_rate += DT * (w**2 * (-0.00231 * felt - self.pitch) - 0.6 * w * self.pitch_rate)
            self.pitch += DT * self.pitch_rate
            shift = self.mass * 0.53 * felt / (2 * 2.59)
            loads = np.array([0.5 * self.mass * 9.80665 * 1.39 / 2.59 - shift] * 2
                             + [0.5 * self.mass * 9.80665 * 1.20 / 2.59 + shift] * 2)  # fmt: skip
            force = (torque - INERTIA * a / RADIUS) / RADIUS - 0.011 * loads
            stiffness = loads * (21.8 + 0.00133 * (loads - 0.25 * MASS * 9.80665))
            slip = force / stiffness * (1 + 0.38 * (force / (1.19 * loads)) ** 2)  # Magic Formula to third order
            late = 0.005 + math.pi * RADIUS / 48 / self.v  # half a sample and half a tooth
            omega = (self.v - late * a) * (1 + slip) / RADIUS
            z = np.zeros(joint.INPUTS)
            z[joint.AX] = felt - 9.80665 * self.pitch + self.bias + noise * 0.02 * self.rng.normal()
            z[joint.DEMAND] = demand
            z[joint.WHEEL : joint.WHEEL + 4] = omega * (1 + noise * 1e-3 * self.rng.normal(size=4))
            z[joint.PRESSURE : joint.PRESSURE + 4] = pressure_pa + self.zero_pa + noise * 1e4 * self.rng.normal(size=4)
            z[joint.MOTOR : joint.MOTOR + 4] = motor_nm
            self.state = joint_step(self.state, z, self.p, DT)
            self.true_torque = torque
        return self.state


def covariance(state):
    return state[joint.COVARIANCE : joint.COVARIANCE + joint.N**2].reshape(joint.N, joint.N)


@pytest.mark.parametrize("mu", [0.28, 0.38, 0.48])
def test_finds_the_pad_friction_and_the_wheel_torque(parameters, mu):
    car = SmallCar(parameters, mu=(mu,) * 4)
    car.run(1.5)
    state = car.run(2.0, 25e5, demand=3.2)
    assert state[FRICTION] == pytest.approx([mu] * 4, rel=0.03)
    assert state[TORQUE] == pytest.approx(car.true_torque, rel=0.03)


@pytest.mark.parametrize(
    "world",
    [{"bias": 0.2}, {"grade": 0.03}, {"zero_pa": 1e5}, {"mass": 1.15 * MASS}, {"bias": -0.2, "grade": -0.03}],
)
def test_is_not_fooled_by(parameters, world):
    car = SmallCar(parameters, mu=(0.30,) * 4, **world)
    car.run(1.0)
    car.run(2.5, motor_nm=300.0)  # known drive teaches the mass
    car.run(1.0)
    state = car.run(1.5, 25e5, demand=3.2)
    assert state[FRICTION] == pytest.approx([0.30] * 4, rel=0.05)


def test_tells_a_weak_rear_axle_from_a_weak_front_axle(parameters):
    car = SmallCar(parameters, mu=(0.38, 0.38, 0.30, 0.30))
    car.run(1.5)
    state = car.run(3.0, 25e5, demand=3.2)
    assert state[FRICTION] == pytest.approx([0.38, 0.38, 0.30, 0.30], rel=0.06)


def test_no_bias_over_seeds(parameters):
    errors = []
    for seed in range(12):
        car = SmallCar(parameters, seed, mu=(0.34,) * 4)
        car.run(1.5)
        errors.append(car.run(2.0, 25e5, demand=3.2)[FRICTION] / 0.34 - 1.0)
    assert np.abs(np.mean(errors, axis=0)) == pytest.approx(0.0, abs=0.02)


def test_holds_when_there_is_nothing_to_learn_from(parameters):
    car = SmallCar(parameters, mu=(0.30,) * 4)
    car.run(1.5)
    learned = car.run(2.0, 25e5, demand=3.2)[FRICTION].copy()
    state = car.run(2.0)
    assert state[FRICTION] == pytest.approx(learned, rel=0.01)
    assert np.all(np.diag(covariance(state))[FRICTION] > 0.0)


def test_mass_is_not_learned_from_friction_braking(parameters):
    car = SmallCar(parameters, mu=(0.25,) * 4)
    car.run(1.0)
    before = car.state[joint.MASS]
    assert car.run(2.0, 25e5, demand=3.2)[joint.MASS] == before


def test_covariance_stays_symmetric_and_positive(parameters):
    car = SmallCar(parameters)
    car.run(1.0)
    for _ in range(6):
        car.run(0.5, 25e5, demand=3.2)
        car.run(0.5, motor_nm=200.0)
        p = covariance(car.state)
        assert np.array_equal(p, p.T)
        assert np.linalg.eigvalsh(p / np.sqrt(np.outer(np.diag(p), np.diag(p)))).min() > -1e-9


def test_state_handed_in_is_not_changed(parameters):
    car = SmallCar(parameters)
    before = car.run(0.5)
    copy = before.copy()
    car.run(0.1)
    assert np.array_equal(before, copy)


@pytest.mark.parametrize("lost", [[joint.AX], list(range(5, 9)), list(range(9, 13)), list(range(13, 17)), [1, 2, 3]])
def test_missing_signals_leave_the_friction_alone(parameters, lost):
    car = SmallCar(parameters)
    car.run(1.0)
    friction = car.run(1.0, 25e5, demand=3.2)[FRICTION].copy()
    z = np.zeros(joint.INPUTS)
    z[joint.AX], z[joint.DEMAND] = -3.3, 3.2
    z[joint.WHEEL : joint.WHEEL + 4] = car.v / RADIUS * 0.99
    z[joint.PRESSURE : joint.PRESSURE + 4] = 25e5
    z[lost] = math.nan
    state = car.state
    for _ in range(5):
        state = joint_step(state, z, car.p, DT)
    assert np.all(np.isfinite(state))
    assert state[FRICTION] == pytest.approx(friction, rel=0.1)


def test_a_locked_wheel_gives_what_the_road_gives(parameters):
    car = SmallCar(parameters)
    car.run(1.0)
    car.run(1.0, 25e5, demand=3.2)
    state, speed = car.state, car.v
    omega = speed / RADIUS
    for k in range(40):  # a road of 0.2 under all wheels: the front wheels spin down within 0.25 s and stand
        speed -= 1.6 * DT
        omega = max(omega - 2.4, 0.0)
        z = np.zeros(joint.INPUTS)
        z[joint.AX], z[joint.DEMAND] = -1.6 + 9.80665 * 0.00231 * -1.6 + 0.001 * (k % 2), 3.2
        z[joint.WHEEL : joint.WHEEL + 4] = [omega, omega, speed / RADIUS * 0.99, speed / RADIUS * 0.99]
        z[joint.PRESSURE : joint.PRESSURE + 4] = 25e5
        state = joint_step(state, z, car.p, DT)
        if k == 10:
            assert state[TORQUE][0] == pytest.approx(car.true_torque[0], rel=0.05)
    assert -260.0 < state[TORQUE][0] < -80.0
    assert state[FRICTION] == pytest.approx([0.38] * 4, rel=0.05)


@pytest.mark.slow
def test_the_same_source_runs_uncompiled(parameters):
    car = SmallCar(parameters)
    car.run(0.5)
    z = np.zeros(joint.INPUTS)
    z[joint.WHEEL : joint.WHEEL + 4] = car.v / RADIUS
    plain = getattr(joint_step, "py_func", joint_step)
    assert plain(car.state, z, car.p, DT) == pytest.approx(joint_step(car.state, z, car.p, DT), rel=1e-9)


def samples(car, ax, speeds):
    z = np.zeros(joint.INPUTS)
    states = []
    for value, speed in zip(ax, speeds, strict=True):
        z[joint.AX] = value
        z[joint.WHEEL : joint.WHEEL + 4] = speed / RADIUS
        car.state = joint_step(car.state, z, car.p, DT)
        states.append(car.state[joint.STUCK])
    return states


def test_a_value_that_repeats_itself_against_the_wheels_is_stuck_until_it_changes(parameters):
    car = SmallCar(parameters)
    car.run(0.5)
    falling = car.v - 2.0 * DT * np.arange(50)
    states = samples(car, [-0.1] * 50, falling)
    assert states[:20] == [0.0] * 20
    assert states[25:] == [1.0] * 25
    assert samples(car, [-2.0, -2.01], falling[-1] - np.array([0.02, 0.04])) == [0.0, 0.0]


def test_a_quiet_sensor_at_steady_speed_is_not_stuck(parameters):
    car = SmallCar(parameters)
    car.run(0.5, noise=0.0)
    assert max(samples(car, [0.0] * 200, [car.v] * 200)) == 0.0


NONE = math.nan


@pytest.mark.parametrize("speeds", [[4.0, 1.0, 3.0, 2.0], [NONE, 5.0, NONE, 1.0], [2.0, 9.0, NONE, 1.0], [3.0] * 4])
def test_the_median_is_numpys(speeds):
    z = np.zeros(joint.INPUTS)
    z[joint.WHEEL : joint.WHEEL + 4] = speeds
    assert median_wheel(z) == np.nanmedian(speeds)

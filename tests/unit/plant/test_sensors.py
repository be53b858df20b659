import math
from dataclasses import replace

import numpy as np
import pytest

from plant.model import pack
from plant.sensors import SENSED, N, Noise, Sensors
from plant.vectors import OUTPUT, STATE, X

PITCH = 2.0 * math.pi / 48
STILL = (
    "wheel_speed_noise", "acceleration_noise_mps2", "yaw_rate_noise_rad_s", "pressure_noise_pa", "pedal_noise",
    "current_noise_a", "steering_noise_rad",
)  # fmt: skip


def turning(time_s: float, angle_rad: float, speed_rad_s: float) -> np.ndarray:
    """State of wheels that have turned by an angle at a constant speed."""
    x = STATE.zeros()
    x[X.time_s] = time_s
    teeth = math.floor(angle_rad / PITCH)
    x[STATE.slice("tooth_count")] = teeth
    x[STATE.slice("tooth_time_s")] = time_s - (angle_rad - teeth * PITCH) / speed_rad_s if teeth else 0.0
    x[STATE.slice("wheel_speed_rad_s")] = speed_rad_s
    return x


@pytest.fixture
def sensors(paper_car):
    """Sensors without noise."""

    def build(speed_rad_s: float, **more) -> Sensors:
        still = dict.fromkeys(STILL, 0.0) | more
        return Sensors(
            pack(replace(paper_car, sensor=replace(paper_car.sensor, **still))), 1, STATE.zeros(), speed_rad_s
        )

    return build


def speed(sensors: Sensors, x: np.ndarray) -> float:
    y = OUTPUT.zeros()
    y[OUTPUT.slice("sensed_wheel_speed_rad_s")] = x[STATE.slice("wheel_speed_rad_s")]
    return sensors.sample(x, y, 0.0, 0.0)[N.wheel_speed_rad_s]


@pytest.mark.parametrize("true", [0.5, 3.0, 65.0, 140.0])
def test_constant_speed_is_exact(sensors, true):
    wheels = sensors(true)
    for k in range(1, 400):
        time_s = 0.01 * k
        measured = speed(wheels, turning(time_s, true * time_s, true))
        if time_s > 2 * PITCH / true:
            assert measured == pytest.approx(true, rel=1e-9)


def test_no_teeth_means_slower_and_then_standing(sensors):
    wheels = sensors(10.0)
    seen = []
    for k in range(1, 80):
        x = STATE.zeros()
        x[X.time_s] = 0.01 * k
        seen.append(speed(wheels, x))
    assert seen == sorted(seen, reverse=True)
    assert seen[20] == pytest.approx(PITCH / 0.21)
    assert seen[-1] == 0.0


def drawn(seed: int, ticks: int) -> np.ndarray:
    noise = Noise(seed)
    return np.array([noise.row() for _ in range(ticks)])


def test_noise_is_fixed_by_the_seed():
    assert (drawn(1, 300) == drawn(1, 300)).all()
    assert not (drawn(1, 300) == drawn(2, 300)).any()


def test_noise_is_standard_normal_and_of_each_signal_its_own():
    noise = drawn(5, 5000)
    assert noise.mean(axis=0) == pytest.approx(0.0, abs=0.06)
    assert noise.std(axis=0) == pytest.approx(1.0, abs=0.04)
    assert len(set(noise.ravel())) == noise.size
    between = np.corrcoef(noise.T) - np.eye(SENSED.size)
    assert np.abs(between).max() < 0.06


def test_offsets_reach_the_signal(sensors):
    offset = sensors(
        0.0, acceleration_offset_mps2=(0.1, -0.2), pressure_offset_pa=(1e5, 2e5, 3e5, 4e5), pedal_offset=(0.01, -0.01),
        yaw_rate_offset_rad_s=0.003,
    )  # fmt: skip
    sensed = offset.sample(STATE.zeros(), OUTPUT.zeros(), 0.5, 0.2)
    assert sensed[SENSED.slice("body_motion")] == pytest.approx([0.1, -0.2, 0.003])
    assert sensed[SENSED.slice("pressure_pa")] == pytest.approx([1e5, 2e5, 3e5, 4e5])
    assert sensed[SENSED.slice("pedal")] == pytest.approx([0.51, 0.49])
    assert sensed[N.steering_wheel_rad] == 0.2

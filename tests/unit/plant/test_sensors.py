import math

import numpy as np
import pytest

from plant.sensors import Noise, Sensors, ToothedWheels
from plant.vectors import STATE, X

PITCH = 2.0 * math.pi / 48


def turning(time_s: float, angle_rad: float, speed_rad_s: float) -> np.ndarray:
    """State of wheels that have turned by an angle at a constant speed."""
    x = STATE.zeros()
    x[X.time_s] = time_s
    teeth = math.floor(angle_rad / PITCH)
    x[STATE.slice("tooth_count")] = teeth
    x[STATE.slice("tooth_time_s")] = time_s - (angle_rad - teeth * PITCH) / speed_rad_s if teeth else 0.0
    return x


@pytest.mark.parametrize("speed", [0.5, 3.0, 65.0, 140.0])
def test_constant_speed_is_exact(paper_car, speed):
    wheels = ToothedWheels(paper_car.sensor, STATE.zeros(), speed)
    for k in range(1, 400):
        time_s = 0.01 * k
        measured = wheels.sample(turning(time_s, speed * time_s, speed))
        if time_s > 2 * PITCH / speed:
            assert measured[0] == pytest.approx(speed, rel=1e-9)


def test_no_teeth_means_slower_and_then_standing(paper_car):
    wheels = ToothedWheels(paper_car.sensor, STATE.zeros(), 10.0)
    seen = []
    for k in range(1, 80):
        x = STATE.zeros()
        x[X.time_s] = 0.01 * k
        seen.append(wheels.sample(x)[0])
    assert seen == sorted(seen, reverse=True)
    assert seen[20] == pytest.approx(PITCH / 0.21)
    assert seen[-1] == 0.0


def test_noise_is_fixed_by_seed_and_signal():
    one, same, other = Noise(1), Noise(1), Noise(2)
    same.normal("pedal", 2)  # another signal in between changes nothing
    assert one.normal("imu", 3) == same.normal("imu", 3)
    assert Noise(1).normal("imu", 3) != other.normal("imu", 3)
    assert Noise(1).normal("imu", 3) != Noise(1).normal("yaw", 3)


def test_noise_is_standard_normal():
    noise = Noise(5)
    drawn = np.array([noise.normal("a", 4) for _ in range(5000)]).ravel()
    assert drawn.mean() == pytest.approx(0.0, abs=0.03)
    assert drawn.std() == pytest.approx(1.0, abs=0.03)
    assert len(set(drawn)) == drawn.size


def test_offsets_reach_the_signal(paper_car):
    from dataclasses import replace

    still = replace(
        paper_car.sensor, acceleration_noise_mps2=0.0, pressure_noise_pa=0.0, pedal_noise=0.0, yaw_rate_noise_rad_s=0.0,
        acceleration_offset_mps2=(0.1, -0.2), pressure_offset_pa=(1e5, 2e5, 3e5, 4e5), pedal_offset=(0.01, -0.01),
        yaw_rate_offset_rad_s=0.003,
    )  # fmt: skip
    from plant.vectors import OUTPUT

    sensors = Sensors(still, 1.75, 1, STATE.zeros(), 0.0)
    assert sensors.body_motion(STATE.zeros()) == pytest.approx((0.1, -0.2, 0.003))
    assert sensors.pressure_pa(OUTPUT.zeros()) == pytest.approx([1e5, 2e5, 3e5, 4e5])
    assert sensors.pedal(0.5) == pytest.approx((0.51, 0.49))

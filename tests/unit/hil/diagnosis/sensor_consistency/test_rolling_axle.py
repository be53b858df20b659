"""Where the wheels of one axle spin or lock, the car's speed is that of the other axle."""

from dataclasses import replace

import numpy as np
import pytest
from motion_logs import RADIUS_M, motion_log

from hil.diagnosis.sensor_consistency.motion import motion_of, rolling_axle

CELL_S = 0.04
T_S = np.arange(1500) * CELL_S
SPEED = 15.0 + 5.0 * np.sin(0.5 * T_S)
ACCELERATES = np.cos(0.5 * T_S) > 0.3


def _wheels(front: np.ndarray, rear: np.ndarray) -> np.ndarray:
    return np.array([front, front, rear, rear])


@pytest.mark.parametrize(
    ("front", "rear", "expected"),
    [
        (SPEED, SPEED, ""),
        (SPEED, SPEED * (1.0 + 0.05 * ACCELERATES), ""),
        (SPEED, SPEED * (1.0 + 0.2 * ACCELERATES), "front"),
        (SPEED * (1.0 + 0.2 * ACCELERATES), SPEED, "rear"),
        (SPEED, SPEED * (1.0 - 0.2 * (np.cos(0.5 * T_S) < -0.5)), "front"),
        (SPEED * (1.0 - 0.2 * (np.cos(0.5 * T_S) < -0.5)), SPEED, "rear"),
    ],
)
def test_the_axle_that_rolls(front: np.ndarray, rear: np.ndarray, expected: str) -> None:
    assert rolling_axle(_wheels(front, rear), np.zeros(len(T_S)), CELL_S) == expected


def test_wheels_that_spin_are_not_the_cars_speed() -> None:
    log = motion_log(3)
    true = log.channels["wheel_speed_fl_rad_s"] * RADIUS_M
    pulls = np.gradient(np.convolve(true, np.ones(50) / 50, "same"), 0.01) > 0.8
    channels = dict(log.channels)
    for wheel in ("rl", "rr"):
        channels[f"wheel_speed_{wheel}_rad_s"] = channels[f"wheel_speed_{wheel}_rad_s"] * (1.0 + 0.3 * pulls)
    spun = motion_of([replace(log, channels=channels)], RADIUS_M)
    rolled = motion_of([log], RADIUS_M)
    assert (rolled.rolling, spun.rolling) == ("", "front")
    assert np.abs(spun.speed_mps - rolled.speed_mps).max() < 0.1

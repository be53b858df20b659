"""A car whose steering nobody logged is held on its line, unless the yaw rate tells of turning."""

import numpy as np
import pytest

from hil.diagnosis.data.log import Log
from hil.diagnosis.data.straight_line import is_straight_line

T_S = np.arange(3000) * 0.01


def _log(**channels: np.ndarray) -> Log:
    return Log("made", T_S, {"wheel_speed_fl_rad_s": np.full(len(T_S), 50.0), **channels})


def _yaw_rate(turning_rad_s: float, zero_rad_s: float = 0.0) -> np.ndarray:
    noise = 0.003 * np.random.default_rng(4).standard_normal(len(T_S))
    return zero_rad_s + turning_rad_s * ((T_S > 8.0) & (T_S < 10.0)) + noise


def test_without_steering_and_yaw_rate_it_is_held() -> None:
    assert is_straight_line([_log(), _log()])


def test_a_steering_wheel_in_one_log_leaves_it_free() -> None:
    assert not is_straight_line([_log(), _log(steer_rad=1e-3 * np.sin(T_S))])


def test_a_steering_wheel_that_is_one_number_tells_nothing() -> None:
    assert is_straight_line([_log(steer_rad=np.zeros(len(T_S)))])
    assert is_straight_line([_log(steer_rad=np.full(len(T_S), np.nan))])


@pytest.mark.parametrize("zero_rad_s", [0.0, 0.01])
def test_noise_and_a_zero_of_the_yaw_rate_are_no_turning(zero_rad_s: float) -> None:
    assert is_straight_line([_log(yaw_rate_rad_s=_yaw_rate(0.0, zero_rad_s))])


def test_a_car_that_is_pulled_round_is_left_free() -> None:
    assert not is_straight_line([_log(), _log(yaw_rate_rad_s=_yaw_rate(0.008))])


def test_a_yaw_rate_of_gaps_says_nothing() -> None:
    assert is_straight_line([_log(yaw_rate_rad_s=np.full(len(T_S), np.nan))])

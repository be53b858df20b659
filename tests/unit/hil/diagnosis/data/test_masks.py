"""Cars that slide are compared up to there; cars whose steering was not logged drive straight unless they turn."""

import numpy as np
import pytest

from hil.diagnosis.data.dataset import Segment
from hil.diagnosis.data.log import Floats, Log, make_log
from hil.diagnosis.data.masks import after_wheel_lock, is_straight_line
from hil.diagnosis.data.prepare import prepare
from plant.signals import WHEELS

RADIUS_M = 0.3
T = np.arange(0.0, 12.0, 0.01)
FROM_S = 6.0


def _wheels(locks: tuple[int, ...] = (1,), within_s: float = 0.3) -> Floats:
    """A car that brakes from 90 rad/s on from 5 s on; some wheels lock at 6 s."""
    rolling = np.clip(90.0 - 15.0 * np.clip(T - 5.0, 0.0, None), 0.0, None)
    wheels = np.column_stack([rolling] * 4)
    share = np.clip((T - FROM_S) / within_s, 0.0, 1.0)
    for wheel in locks:
        wheels[:, wheel] *= 1.0 - share
    return wheels


def _since(wheels: Floats, ground: Floats | None = None, acting: bool = True) -> float | None:
    ground = np.full(len(T), np.nan) if ground is None else ground
    segments = (Segment(0, len(T), 90.0, None),)
    masked = after_wheel_lock(wheels, ground, np.full(len(T), acting), segments, RADIUS_M)
    return float(T[np.argmax(masked)]) if masked.any() else None


def test_a_wheel_that_locks_ends_the_comparison_where_it_left_the_others() -> None:
    assert _since(_wheels()) == pytest.approx(FROM_S + 0.06, abs=0.02)


def test_all_four_wheels_that_lock_are_seen_beside_a_speed_over_ground() -> None:
    wheels = _wheels((0, 1, 2, 3))
    ground = RADIUS_M * _wheels(())[:, 0]
    assert _since(wheels) is None
    assert _since(wheels, ground) == pytest.approx(FROM_S + 0.06, abs=0.02)


def test_a_wheel_that_is_let_go_again_at_once_rolls_on() -> None:
    """A controller of slip lets a wheel go within a tenth of a second."""
    wheels = _wheels(())
    wheels[(T > FROM_S) & (T < FROM_S + 0.08), 1] *= 0.4
    assert _since(wheels) is None


def test_a_sensor_that_is_always_zero_is_no_wheel_that_slides() -> None:
    wheels = _wheels(())
    wheels[:, 1] = 0.0
    assert _since(wheels) is None


def test_a_sensor_that_stops_while_nothing_brakes_is_no_wheel_that_slides() -> None:
    assert _since(_wheels(), acting=False) is None


def test_the_next_segment_is_compared_again() -> None:
    wheels = _wheels()
    wheels[T > 7.0, 1] = wheels[T > 7.0, 0]
    segments = (Segment(0, 800, 90.0, None), Segment(800, len(T), 40.0, None))
    masked = after_wheel_lock(wheels, np.full(len(T), np.nan), np.ones(len(T), bool), segments, RADIUS_M)
    assert masked[799]
    assert not masked[800:].any()


def test_a_remark_says_from_where_on_a_log_is_not_compared() -> None:
    channels = {f"wheel_speed_{w}_rad_s": _wheels()[:, k] for k, w in enumerate(WHEELS)}
    channels |= {f"pressure_{w}_pa": np.where(T > 5.0, 40e5, 0.0) for w in WHEELS}
    (drive,) = prepare([make_log("log", T, channels)], RADIUS_M).recordings
    times = np.arange(drive.samples) * drive.stride * 0.01
    assert drive.moving[times < FROM_S].all()
    assert not drive.moving[times > FROM_S + 0.1].any()
    (remark,) = [text for text in drive.log.remarks if "slides" in text]
    assert "6.0" in remark


YAW_T_S = np.arange(3000) * 0.01


def _made(**channels: np.ndarray) -> Log:
    return Log("made", YAW_T_S, {"wheel_speed_fl_rad_s": np.full(len(YAW_T_S), 50.0), **channels})


def _yaw_rate(turning_rad_s: float, zero_rad_s: float = 0.0) -> np.ndarray:
    noise = 0.003 * np.random.default_rng(4).standard_normal(len(YAW_T_S))
    return zero_rad_s + turning_rad_s * ((YAW_T_S > 8.0) & (YAW_T_S < 10.0)) + noise


def test_without_steering_and_yaw_rate_the_car_drives_straight() -> None:
    assert is_straight_line([_made(), _made()])


def test_a_steering_wheel_that_moves_in_one_log_lets_it_turn() -> None:
    assert not is_straight_line([_made(), _made(steer_rad=1e-3 * np.sin(YAW_T_S))])


def test_a_constant_steering_wheel_was_not_measured() -> None:
    assert is_straight_line([_made(steer_rad=np.zeros(len(YAW_T_S)))])
    assert is_straight_line([_made(steer_rad=np.full(len(YAW_T_S), np.nan))])


@pytest.mark.parametrize("zero_rad_s", [0.0, 0.01])
def test_noise_and_offset_of_the_yaw_rate_are_no_turning(zero_rad_s: float) -> None:
    assert is_straight_line([_made(yaw_rate_rad_s=_yaw_rate(0.0, zero_rad_s))])


def test_a_car_that_turns_is_not_straight() -> None:
    assert not is_straight_line([_made(), _made(yaw_rate_rad_s=_yaw_rate(0.008))])


def test_a_yaw_rate_without_values_was_not_measured() -> None:
    assert is_straight_line([_made(yaw_rate_rad_s=np.full(len(YAW_T_S), np.nan))])

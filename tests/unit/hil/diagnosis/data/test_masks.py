"""Cars that slide: compared up to there, and not after."""

import numpy as np
import pytest

from hil.diagnosis.data.dataset import Segment
from hil.diagnosis.data.log import Floats, make_log
from hil.diagnosis.data.masks import after_wheel_lock
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
    found = after_wheel_lock(wheels, ground, np.full(len(T), acting), segments, RADIUS_M)
    return float(T[np.argmax(found)]) if found.any() else None


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


def test_a_sensor_that_never_told_anything_is_no_wheel_that_slides() -> None:
    wheels = _wheels(())
    wheels[:, 1] = 0.0
    assert _since(wheels) is None


def test_a_sensor_that_stops_while_nothing_brakes_is_no_wheel_that_slides() -> None:
    assert _since(_wheels(), acting=False) is None


def test_a_segment_that_begins_anew_is_compared_again() -> None:
    wheels = _wheels()
    wheels[T > 7.0, 1] = wheels[T > 7.0, 0]
    segments = (Segment(0, 800, 90.0, None), Segment(800, len(T), 40.0, None))
    found = after_wheel_lock(wheels, np.full(len(T), np.nan), np.ones(len(T), bool), segments, RADIUS_M)
    assert found[799]
    assert not found[800:].any()


def test_a_log_says_where_it_is_not_compared_any_more() -> None:
    channels = {f"wheel_speed_{w}_rad_s": _wheels()[:, k] for k, w in enumerate(WHEELS)}
    channels |= {f"pressure_{w}_pa": np.where(T > 5.0, 40e5, 0.0) for w in WHEELS}
    (drive,) = prepare([make_log("log", T, channels)], RADIUS_M).recordings
    times = np.arange(drive.samples) * drive.stride * 0.01
    assert drive.moving[times < FROM_S].all()
    assert not drive.moving[times > FROM_S + 0.1].any()
    (said,) = [text for text in drive.log.remarks if "slides" in text]
    assert "6.0" in said

"""Logs into replays: demands that the measurement contradicts are left out."""

import numpy as np
import pytest

from hil.study.prepare import _begin_s, _wait_s, prepare
from hil.study.table import Log, make_log

WHEELS = ("fl", "fr", "rl", "rr")


def _log(asked: float, given: float) -> Log:
    """Ten seconds at 20 m/s with a braking pressure in the middle of it."""
    t = np.arange(1000) * 0.01
    braking = (t > 3.0) & (t < 6.0)
    channels = {f"wheel_speed_{w}_rad_s": np.full(1000, 60.0) for w in WHEELS}
    channels |= {f"pressure_{w}_pa": given * braking for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": asked * braking for w in WHEELS}
    return make_log("log", t, channels)


@pytest.mark.parametrize(("asked", "kept"), [(20e5, True), (0.0, False)])
def test_demands_that_nobody_followed_are_left_out(asked: float, kept: bool) -> None:
    case = prepare([_log(20e5, 20e5), _log(asked, 20e5)], 0.3)
    assert ("pressure" in case.groups) is kept
    for drive in case.drives:
        assert drive.log.has("pressure_demand_fl_pa") is kept
        assert any("demands left out" in text for text in drive.log.remarks) is not kept
    assert [drive.number for drive in case.drives] == [0, 1]


def test_released_brakes_contradict_nothing() -> None:
    assert "pressure" in prepare([_log(0.0, 0.0)], 0.3).groups


def test_stamps_tell_how_long_frames_wait() -> None:
    """Two waiting times of mean w are sqrt(2) w apart."""
    rng = np.random.default_rng(1)
    regular = np.arange(20000) * 0.01
    assert _wait_s(regular) == pytest.approx(0.0, abs=1e-9)
    assert _wait_s(regular + rng.exponential(3e-4, 20000)) == pytest.approx(2**0.5 * 3e-4, rel=0.03)
    gaps = np.concatenate((regular[:900], regular[1000:]))
    assert _wait_s(gaps) == pytest.approx(0.0, abs=1e-9)


def test_rows_begin_by_the_cycle_whatever_the_first_frame_waited() -> None:
    """All logs of a car wait alike; a first frame that waited 3 ms moves no demand, gaps do not either."""
    rng = np.random.default_rng(2)
    stamps = np.arange(2000) * 0.01 + rng.exponential(3e-4, 2000)
    usual = 3e-4 * np.log(2.0)
    for first in (0.0, 3e-3):
        stamps[0] = first
        assert _begin_s(stamps) == pytest.approx(usual, abs=5e-5)
        assert _begin_s(np.delete(stamps, np.s_[500:700])) == pytest.approx(usual, abs=5e-5)
        assert _begin_s(stamps + 7.0) == pytest.approx(7.0 + usual, abs=5e-5)


def test_rows_of_irregular_stamps_begin_with_the_first() -> None:
    rng = np.random.default_rng(3)
    stamps = np.cumsum(rng.uniform(0.001, 0.02, 500))
    assert _begin_s(stamps) == stamps[0]
    assert _begin_s(np.array([4.0])) == 4.0

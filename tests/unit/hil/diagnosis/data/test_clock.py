"""Time stamps of a log: its cycle, and the jitter of its frames."""

import numpy as np
import pytest

from hil.diagnosis.data.clock import clock_origin_s, timestamp_jitter_s


def test_jitter_is_the_difference_of_two_delays() -> None:
    """Two exponential delays of mean w differ by sqrt(2) w, rms."""
    rng = np.random.default_rng(1)
    regular = np.arange(20000) * 0.01
    assert timestamp_jitter_s(regular) == pytest.approx(0.0, abs=1e-9)
    assert timestamp_jitter_s(regular + rng.exponential(3e-4, 20000)) == pytest.approx(2**0.5 * 3e-4, rel=0.03)
    gaps = np.concatenate((regular[:900], regular[1000:]))
    assert timestamp_jitter_s(gaps) == pytest.approx(0.0, abs=1e-9)


def test_the_origin_is_that_of_the_cycle_whatever_the_first_delay() -> None:
    """Neither a first frame that is 3 ms late nor gaps move it."""
    rng = np.random.default_rng(2)
    stamps = np.arange(2000) * 0.01 + rng.exponential(3e-4, 2000)
    typical = 3e-4 * np.log(2.0)
    for first in (0.0, 3e-3):
        stamps[0] = first
        assert clock_origin_s(stamps) == pytest.approx(typical, abs=5e-5)
        assert clock_origin_s(np.delete(stamps, np.s_[500:700])) == pytest.approx(typical, abs=5e-5)
        assert clock_origin_s(stamps + 7.0) == pytest.approx(7.0 + typical, abs=5e-5)


def test_the_origin_of_irregular_stamps_is_the_first() -> None:
    rng = np.random.default_rng(3)
    stamps = np.cumsum(rng.uniform(0.001, 0.02, 500))
    assert clock_origin_s(stamps) == stamps[0]
    assert clock_origin_s(np.array([4.0])) == 4.0

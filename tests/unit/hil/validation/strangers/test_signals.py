"""What loggers do to signals, against closed forms."""

import numpy as np
import pytest

from hil.validation.strangers.signals import low_pass, slow_noise, tooth_speeds


def test_slow_noise_has_its_size_and_its_time():
    noise = slow_noise(np.random.default_rng(1), 400_000, 0.01, 2.0, 0.1)
    assert noise.std() == pytest.approx(2.0, rel=0.03)
    assert np.corrcoef(noise[:-10], noise[10:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.02)


def test_a_filter_of_second_order_is_late_on_a_ramp_by_twice_its_damping():
    ramp = np.arange(4000) * 0.001
    late = ramp[-1] - low_pass(ramp, 0.001, 20.0)[-1]
    assert late == pytest.approx(2.0 * 0.7 / (2.0 * np.pi * 20.0), abs=0.001)


def test_teeth_tell_the_mean_speed_since_the_last_message_and_rest():
    t = np.arange(0.0, 4.0, 0.001)
    speed = np.maximum(30.0 - 10.0 * t, 0.0)
    angle = np.cumsum(speed) * 0.001
    messages = np.arange(0.02, 4.0, 0.02)
    stamps, told = tooth_speeds(t, angle, messages, 44)
    fast = (messages > 0.03) & (messages < 2.0)
    # speed falls evenly: the mean between two edges is that of their middle
    assert np.abs(told[fast] - (30.0 - 10.0 * stamps[fast])).max() < 0.02
    assert np.all(np.diff(stamps) >= 0.0)
    assert told[messages > 3.4].max() == 0.0

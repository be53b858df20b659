"""Short logs: stops of 2 to 4 s are served, alone or many together, or refused with what to do."""

import numpy as np
import pytest

from hil.diagnosis.data.log import WHEEL_SPEED, UnusableError, make_log
from hil.diagnosis.data.masks import moving_and_resting
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.sensor_consistency.longitudinal import LongitudinalModel
from hil.diagnosis.sensor_consistency.motion import motion_of

RADIUS_M = 0.31
RATES_HZ = (10.0, 25.0, 50.0, 100.0, 200.0)


def stop(length_s: float, rate_hz: float, number: int = 0):
    """A stop from 20 m/s after 0.3 s at 8 m/s2, with as many samples as ``length_s`` has at that rate."""
    t = np.arange(round(length_s * rate_hz)) / rate_hz
    speed = np.clip(20.0 - 8.0 * np.maximum(t - 0.3, 0.0), 0.0, None)
    braking = 4e6 * ((t > 0.3) & (speed > 0.0))
    rng = np.random.default_rng(number)
    channels = {name: speed / RADIUS_M + 0.02 * rng.standard_normal(len(t)) for name in WHEEL_SPEED}
    channels |= {f"pressure_{w}_pa": braking for w in ("fl", "fr", "rl", "rr")}
    channels |= {"ax_mps2": np.gradient(speed, t), "speed_mps": speed}
    return make_log(f"stop{number}", t, channels)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("length_s", [0.5, 1.0, 2.0, 2.5, 3.0, 4.0])
def test_eight_stops_of_any_length_are_prepared_or_refused(length_s: float, rate_hz: float) -> None:
    if length_s < 2.0:
        with pytest.raises(UnusableError, match=r"expected 2 s or more .*; leave it out, or record from before"):
            stop(length_s, rate_hz)
        return
    dataset = prepare([stop(length_s, rate_hz, k) for k in range(8)], RADIUS_M)
    assert len(dataset.segments) == 8
    for one in dataset.recordings:
        assert len(one.moving) == len(one.resting) == one.samples
        assert all(len(values) == one.samples for values in one.measured.values())


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("length_s", [2.0, 3.0, 4.0])
def test_one_short_stop_is_refused_with_what_to_do(length_s: float, rate_hz: float) -> None:
    with pytest.raises(UnusableError, match=r"moves for \d.\d s in all logs; expected 4 s or more .*; add logs"):
        prepare([stop(length_s, rate_hz)], RADIUS_M)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_sensors_are_compared_in_short_stops(rate_hz: float) -> None:
    motion = motion_of([stop(3.0, rate_hz, k) for k in range(4)], RADIUS_M)
    model = LongitudinalModel(motion)
    noise = {name: one.typical for name, one in model.noise.items()}
    assert np.isfinite(model.log_likelihood({}, noise)).all()


@pytest.mark.parametrize("samples", [1, 10, 200, 201, 400, 1000])
def test_masks_are_as_long_as_the_log(samples: int) -> None:
    """Rest is compared from 2 s after a stop on and to 2 s before a start, wherever the log begins or ends."""
    speed = np.zeros(samples)
    speed[: samples // 10] = 5.0
    moving, resting = moving_and_resting(speed, 0.02)
    assert len(moving) == len(resting) == samples
    expected = np.arange(samples) >= max(samples // 10 + 100, 2 * 50)
    assert (resting == expected).all()

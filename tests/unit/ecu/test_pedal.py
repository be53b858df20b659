"""Two pedal channels, one of which may say anything."""

import itertools
import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ecu.law import pedal

DT_S = 0.01


def follow(parameters, inputs, pairs, lost=False):
    """Readings of one sample after the other, 10 ms apart."""
    memory, readings = pedal.INITIAL, []
    for one, two in pairs:
        memory, reading = pedal.read_pedal(
            memory,
            inputs._replace(pedal_1=one, pedal_2=two),
            lost,
            parameters.supervision,
            parameters.plausibility,
            DT_S,
        )
        readings.append(reading)
    return readings


@pytest.mark.parametrize(
    ("one", "two", "travel"),
    [(0.5, 0.52, 0.51), (0.5, 0.1, 0.5), (0.1, 0.5, 0.5), (math.nan, 0.3, 0.3), (0.3, math.inf, 0.3)],
)
def test_channels(parameters, good_inputs, one, two, travel):
    reading = follow(parameters, good_inputs, [(one, two)])[0]
    assert reading.travel == pytest.approx(travel)
    assert (reading.channel_1_lost, reading.channel_2_lost) == (not math.isfinite(one), not math.isfinite(two))


def test_no_channel_gives_no_travel(parameters, good_inputs):
    assert math.isnan(follow(parameters, good_inputs, [(0.5, 0.5)], lost=True)[0].travel)
    assert math.isnan(follow(parameters, good_inputs, [(math.nan, math.nan)])[0].travel)


@pytest.mark.parametrize("channel", [1, 2])
def test_a_spike_in_one_frame_of_five_is_not_followed_and_is_named(parameters, good_inputs, channel):
    pairs = [(0.6, 0.6), *[(1.0, 0.6) if n % 5 == 0 else (0.6, 0.6) for n in range(60)]]
    readings = follow(parameters, good_inputs, [p if channel == 1 else p[::-1] for p in pairs])
    assert {r.travel for r in readings} == {0.6}
    told = [n for n, r in enumerate(readings) if r.channels_disagree]
    assert told[0] == 16
    assert all(r.implausible == (channel == 1, channel == 2) for r in readings[told[0] :])


def test_a_channel_that_falls_never_releases_the_brake(parameters, good_inputs):
    dead = follow(parameters, good_inputs, [(0.6, 0.6)] * 3 + [(0.0, 0.6)] * 50)
    drifting = follow(parameters, good_inputs, [(0.6 - 0.004 * n, 0.6) for n in range(150)])
    stuck = follow(parameters, good_inputs, [(0.6, 0.6 - 0.02 * n) for n in range(30)])  # the driver lets go
    assert all(r.travel >= 0.57 for r in dead + drifting + stuck)
    assert dead[5].implausible == (True, False)  # it jumped; of the others nobody can tell
    assert stuck[-1].channels_disagree
    assert stuck[-1].implausible == (False, False)


def test_what_only_one_channel_asks_for_rises_no_faster_than_a_quick_foot(parameters, good_inputs):
    readings = follow(parameters, good_inputs, [(0.3, 0.3), (0.4, 0.3), (0.5, 0.3), (0.6, 0.3), (0.7, 0.3), (0.7, 0.3)])
    rise = parameters.plausibility.pedal_rise_1_s * DT_S
    travels = [r.travel for r in readings]
    assert max(b - a for a, b in itertools.pairwise(travels)) <= rise + 1e-12
    assert travels[-1] == pytest.approx(0.3 + 5 * rise)


def test_both_channels_together_may_do_what_they_like(parameters, good_inputs):
    readings = follow(parameters, good_inputs, [(0.0, 0.0), (1.0, 0.99), (0.0, 0.02), (0.8, 0.8)])
    assert [r.travel for r in readings] == pytest.approx([0.0, 0.995, 0.01, 0.8])
    assert not any(r.channels_disagree for r in readings)


travels = st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.3, 0.6, 1.0, math.nan, math.inf]))


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(pairs=st.lists(st.tuples(travels, travels), min_size=1, max_size=60))
def test_never_below_both_channels_and_never_above(parameters, good_inputs, pairs):
    for (one, two), r in zip(pairs, follow(parameters, good_inputs, pairs), strict=True):
        there = [x for x in (one, two) if math.isfinite(x)]
        assert math.isnan(r.travel) if not there else min(there) <= r.travel <= max(there)
        assert r.implausible != (True, True)

"""Two pedal channels, one of which may say anything."""

import itertools
import math
from dataclasses import replace

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


TICK_S = 1 / 64
AT_REST = pedal.PedalMemory(0.5, (0.5, 0.5), 0, (0.0, 0.0, 0.0))
LEVELS_S = (0.5 * TICK_S, 0.25 * TICK_S, 1.5 * TICK_S)
FOUND_1, FOUND_2 = (9 * TICK_S, 0.0, 9 * TICK_S), (0.0, 9 * TICK_S, 9 * TICK_S)


@pytest.fixture
def read(parameters, good_inputs):
    """One sample; limits are sums of powers of two: 1/8 apart, a jump of 1/4, 1/16 a sample, 3 samples."""
    s = replace(parameters.supervision, pedal_disagreement=0.125, pedal_disagreement_s=3 * TICK_S)
    p = replace(parameters.plausibility, pedal_jump=0.25, pedal_rise_1_s=4.0, forget=0.25, heal_s=16 * TICK_S)

    def one_sample(memory, one, two, lost=False):
        return pedal.read_pedal(memory, good_inputs._replace(pedal_1=one, pedal_2=two), lost, s, p, TICK_S)

    return one_sample


def swapped(memory):
    return memory._replace(
        last=memory.last[::-1],
        suspect=(0, 2, 1)[memory.suspect],
        levels=(memory.levels[1], memory.levels[0], memory.levels[2]),
    )


JUST = 1e-9


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(
    ("memory", "one", "two", "travel", "suspect"),
    [
        (AT_REST, 0.625, 0.5, 0.5625, 0),  # they agree
        (AT_REST, 0.625 + JUST, 0.5, 0.5625, 0),  # they do not: the larger, by the quick foot
        (AT_REST, 0.375 - JUST, 0.5, 0.5, 0),
        (AT_REST, 0.75, 0.5, 0.5625, 0),  # no jump
        (AT_REST, 0.75 + JUST, 0.5, 0.5, 1),
        (AT_REST, 0.25, 0.5, 0.5, 0),
        (AT_REST, 0.25 - JUST, 0.5, 0.5, 1),
        (AT_REST, 1.0, 0.76, 0.76, 0),  # both jump: never below both
        (AT_REST, 0.0, 1.0, 0.5625, 0),
        (AT_REST, 0.1, 0.24, 0.24, 0),  # nor above both
        (AT_REST._replace(last=(0.9, 0.5)), 0.3, 0.5, 0.5, 0),  # back to what is acted on
        (AT_REST._replace(last=(0.9, 0.5)), 0.25, 0.5, 0.5, 0),
        (AT_REST._replace(last=(0.9, 0.5)), 0.25 - JUST, 0.5, 0.5, 1),
        (AT_REST._replace(last=(0.1, 0.5)), 0.75, 0.5, 0.5625, 0),
        (AT_REST._replace(last=(1.0, 0.5), suspect=1), 1.0, 0.55, 0.55, 1),  # it stays suspect
        (AT_REST._replace(last=(1.0, 0.5), suspect=1), 0.7, 0.5, 0.5, 1),
        (AT_REST._replace(last=(1.0, 0.5), suspect=1), 1.0, 0.75, 0.75, 1),
        (AT_REST._replace(last=(1.0, 0.5), suspect=1), 1.0, 0.75 + JUST, 0.75 + JUST, 0),  # the trusted one jumps, too
        (AT_REST._replace(last=(1.0, 0.5), suspect=1), 0.6, 0.55, 0.575, 0),  # they agree again
        (AT_REST._replace(travel=math.nan), 0.7, 0.5, 0.7, 0),
        (AT_REST._replace(travel=0.2, last=(0.2, 0.2)), 0.4, 0.25, 0.2625, 0),
    ],
)
def test_which_channel_is_followed(read, memory, one, two, travel, suspect, swap):
    if swap:
        memory, one, two, suspect = swapped(memory), two, one, (0, 2, 1)[suspect]
    after, reading = read(memory, one, two)
    assert reading.travel == after.travel == pytest.approx(travel, abs=1e-12)
    assert after.suspect == suspect
    assert after.last == (one, two)
    apart = abs(one - two) > 0.125
    assert after.levels == (
        TICK_S if suspect == 1 else 0.0, TICK_S if suspect == 2 else 0.0, TICK_S if apart else 0.0
    )  # fmt: skip
    assert reading[1:] == (False, False, False, (False, False))


def test_levels_count_up_and_slowly_down(read):
    after, reading = read(AT_REST._replace(levels=LEVELS_S), 0.5, 0.5625)
    assert reading.travel == 0.53125
    assert after.levels == (0.25 * TICK_S, 0.0, 1.25 * TICK_S)
    after, reading = read(AT_REST._replace(levels=LEVELS_S), 0.9, 0.5)
    assert after.levels == (1.5 * TICK_S, 0.0, 2.5 * TICK_S)
    assert not reading.channels_disagree
    after, reading = read(after, 0.9, 0.5)
    assert after.levels == (2.5 * TICK_S, 0.0, 19 * TICK_S)
    assert reading[1:] == (False, False, True, (False, False))
    after, reading = read(after, 0.9, 0.5)
    assert after.levels == (19 * TICK_S, 0.0, 19 * TICK_S)
    assert reading[1:] == (False, False, True, (True, False))


@pytest.mark.parametrize(
    ("levels", "believed", "wrong"), [(FOUND_1, 0.5, (True, False)), (FOUND_2, 0.55, (False, True))]
)
def test_a_channel_that_was_found_wrong_is_not_followed_even_where_it_agrees(read, levels, believed, wrong):
    after, reading = read(AT_REST._replace(levels=levels), 0.55, 0.5)
    assert reading == (believed, False, False, True, wrong)
    assert after.travel == believed
    after, reading = read(AT_REST._replace(levels=levels), 0.7, 0.5)  # nor where it drifts away
    assert reading.travel == (0.5 if wrong[0] else 0.7)
    assert after.suspect == (1 if wrong[0] else 2)


def test_of_two_that_were_found_the_one_with_more_evidence_is_named(read):
    both = AT_REST._replace(levels=(9 * TICK_S, 9 * TICK_S, 9 * TICK_S))
    assert read(both, 0.5, 0.5)[1].implausible == (True, False)
    assert read(both._replace(levels=(8 * TICK_S, 9 * TICK_S, 0.0)), 0.5, 0.5)[1].implausible == (False, True)
    assert read(AT_REST._replace(levels=(3 * TICK_S, 3 * TICK_S, 3 * TICK_S)), 0.5, 0.5)[1].implausible == (
        False,
        False,
    )


@pytest.mark.parametrize(
    ("one", "two", "lost", "travel", "held", "last"),
    [
        (math.nan, 0.7, False, 0.7, 0.7, (math.nan, 0.7)),
        (0.7, math.inf, False, 0.7, 0.7, (0.7, math.inf)),
        (math.nan, math.nan, False, math.nan, 0.5, (math.nan, math.nan)),
        (0.7, 0.7, True, math.nan, 0.5, (0.5, 0.5)),
    ],
)
def test_what_is_kept_where_a_channel_is_lost(read, one, two, lost, travel, held, last):
    before = AT_REST._replace(suspect=1, levels=(0.0, 0.5 * TICK_S, 9 * TICK_S))
    after, reading = read(before, one, two, lost)
    assert reading.travel == travel or (math.isnan(reading.travel) and math.isnan(travel))
    assert (after.travel, after.suspect) == (held, 0)
    assert [repr(x) for x in after.last] == [repr(x) for x in last]
    assert after.levels == (0.0, 0.25 * TICK_S, 8 * TICK_S)
    assert reading[1:] == (lost or not math.isfinite(one), lost or not math.isfinite(two), True, (False, False))
    assert not read(AT_REST._replace(levels=(0.0, 0.0, 3 * TICK_S)), one, two, lost)[1].channels_disagree

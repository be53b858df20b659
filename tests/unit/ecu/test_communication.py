"""What is held against a stream: any pattern of bad frames above one in four, foreign frames above one in five."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.law.communication import ALL_CLEAN, judge_streams
from ecu.law.types import WELL, Health, Source

IN_TIME = (False,) * len(Source)
BAD = Health(0.01, False, 1, bad=1)
FOREIGN = Health(0.0, True, 0, foreign=1)
DOUBLED = Health(0.0, True, 0, doubled=1)
QUIET = Health(0.02, False, 0)


def course(pattern, p, timed_out=False):
    """The steering's stream after each tick of a pattern."""
    streams, seen = ALL_CLEAN, []
    for health in pattern:
        all_health = [WELL] * len(Source)
        all_health[Source.STEERING] = health
        out = tuple(timed_out and s is Source.STEERING for s in Source)
        streams = judge_streams(streams, all_health, out, p.supervision, 0.01)
        assert all(s == ALL_CLEAN[0] for i, s in enumerate(streams) if i != Source.STEERING)
        seen.append(streams[Source.STEERING])
    return seen


def first(flags):
    return flags.index(True) + 1


def test_five_bad_frames_in_a_row_and_any_high_rate_are_found(parameters):
    found = {
        name: first([s.corrupted for s in course(pattern * 50, parameters)])
        for name, pattern in {
            "all": [BAD], "two of three": [BAD, BAD, WELL], "half": [BAD, WELL], "a third": [BAD, WELL, WELL],
            "two of seven": [BAD, WELL, WELL, WELL, BAD, WELL, WELL],
        }.items()
    }  # fmt: skip
    print(found)
    assert found["all"] == 5
    assert found["two of three"] <= 9
    assert found["half"] <= 15
    assert found["a third"] <= 45
    assert found["two of seven"] <= 105


@settings(max_examples=25)
@given(st.lists(st.booleans(), min_size=1, max_size=16).filter(lambda p: sum(p) / len(p) >= 0.3))
def test_any_repeated_pattern_of_three_in_ten_is_found_and_stays_found(parameters, pattern):
    seen = [s.corrupted for s in course([BAD if bad else WELL for bad in pattern] * 40, parameters)]
    assert True in seen
    assert all(seen[seen.index(True) :])


@settings(max_examples=25)
@given(st.lists(st.sampled_from([WELL, WELL, WELL, QUIET, QUIET]), min_size=1, max_size=80))
def test_lost_frames_are_no_bad_frames(parameters, pattern):
    assert course(pattern, parameters)[-1] == ALL_CLEAN[0]


def test_a_bad_frame_in_five_is_tolerated_and_forgotten(parameters):
    seen = course([BAD, WELL, WELL, WELL, WELL] * 100, parameters)
    assert not any(s.corrupted for s in seen)
    assert course([BAD, *[WELL] * 110], parameters)[-1] is ALL_CLEAN[0]


def test_what_was_found_heals_after_a_second_without_any_odd_frame(parameters):
    seen = course([BAD] * 10 + ([WELL] * 90 + [BAD]) * 3 + [WELL] * 150, parameters)
    healed = next(i for i, s in enumerate(seen) if i > 10 and not s.corrupted)
    assert healed == 10 + 3 * 91 + 99
    assert seen[-1] is ALL_CLEAN[0]


@pytest.mark.parametrize(("timed_out", "what"), [(False, "second_sender"), (True, "out_of_time")])
def test_three_foreign_frames_are_a_second_sender_or_a_replay(parameters, timed_out, what):
    seen = course([FOREIGN] * 3, parameters, timed_out)
    assert [getattr(s, what) for s in seen] == [False, False, True]
    assert all(s.suspect for s in seen)
    assert seen[-1].second_sender != seen[-1].out_of_time


def test_foreign_frames_now_and_then_are_found_above_one_in_five(parameters):
    assert any(s.second_sender for s in course([FOREIGN, WELL, WELL, WELL] * 30, parameters))
    assert not any(s.second_sender for s in course([FOREIGN, WELL, WELL, WELL, WELL] * 100, parameters))


def test_frames_that_come_twice_are_a_second_sender_above_every_other(parameters):
    assert first([s.second_sender for s in course([DOUBLED] * 20, parameters)]) == 12
    assert not any(s.second_sender for s in course([DOUBLED, WELL] * 100, parameters))

"""What is held against a stream: any pattern of bad frames above one in four, foreign frames above one in five."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ecu.law.communication import ALL_CLEAN, CLEAN, judge_streams
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


LIMITS = {
    "bad_frame_weight": 3, "bad_frames_to_downgrade": 5, "foreign_frame_weight": 4, "foreign_frames_to_downgrade": 3,
    "communication_healing_s": 8 / 64,
}  # fmt: skip


@pytest.fixture
def judge(parameters):
    """One tick of 1/64 s of the steering's stream; eight without an odd frame heal."""
    p = replace(parameters.supervision, **LIMITS)

    def one_tick(stream, timed_out=False, **health):
        streams = tuple(stream if s is Source.STEERING else CLEAN for s in Source)
        all_health = tuple(WELL._replace(**health) if s is Source.STEERING else WELL for s in Source)
        out = tuple(timed_out and s is Source.STEERING for s in Source)
        return judge_streams(streams, all_health, out, p, 1 / 64)[Source.STEERING]

    return one_tick


@pytest.mark.parametrize(
    ("before", "timed_out", "health", "after"),
    [
        ((0, 0, 0, 0.0), False, {"bad": 1, "fresh": False}, (3, 0, 0, 0.0, False, False, False)),
        ((0, 0, 0, 0.0), False, {"bad": 2}, (6, 0, 0, 0.0, False, False, False)),
        ((0, 0, 0, 0.0), False, {"foreign": 3}, (0, 4, 0, 0.0, False, False, False)),  # of one tick: once
        ((0, 0, 0, 0.0), False, {"doubled": 3}, (0, 0, 1, 0.0, False, False, False)),
        ((5, 5, 5, 2 / 64), False, {}, (4, 4, 4, 3 / 64, False, False, False)),
        ((5, 5, 5, 2 / 64), False, {"fresh": False}, (5, 5, 5, 3 / 64, False, False, False)),
        ((5, 5, 5, 2 / 64), True, {"fresh": False}, (5, 5, 5, 0.0, False, False, False)),
        ((5, 5, 5, 2 / 64), False, {"bad": 1, "fresh": False}, (8, 5, 5, 0.0, False, False, False)),
        ((5, 5, 5, 2 / 64), False, {"foreign": 1}, (4, 9, 4, 0.0, False, False, False)),
        ((5, 5, 5, 2 / 64), False, {"doubled": 1}, (4, 4, 6, 0.0, False, False, False)),
        ((11, 0, 0, 0.0), False, {"bad": 1}, (14, 0, 0, 0.0, False, False, False)),
        ((12, 0, 0, 0.0), False, {"bad": 1}, (15, 0, 0, 0.0, True, False, False)),
        ((16, 0, 0, 0.0), False, {}, (15, 0, 0, 1 / 64, True, False, False)),
        ((15, 0, 0, 0.0), False, {}, (14, 0, 0, 1 / 64, False, False, False)),
        ((29, 0, 0, 0.0), False, {"bad": 1}, (30, 0, 0, 0.0, True, False, False)),  # twice the limit at most
        ((0, 7, 0, 0.0), False, {"foreign": 1}, (0, 11, 0, 0.0, False, False, False)),
        ((0, 8, 0, 0.0), False, {"foreign": 1}, (0, 12, 0, 0.0, False, True, False)),
        ((0, 8, 0, 0.0), True, {"foreign": 1}, (0, 12, 0, 0.0, False, False, True)),
        ((0, 23, 0, 0.0), False, {"foreign": 1}, (0, 24, 0, 0.0, False, True, False)),
        ((0, 0, 10, 0.0), False, {"doubled": 1}, (0, 0, 11, 0.0, False, False, False)),
        ((0, 0, 11, 0.0), False, {"doubled": 1}, (0, 0, 12, 0.0, False, True, False)),
        ((0, 0, 24, 0.0), False, {"doubled": 1}, (0, 0, 24, 0.0, False, True, False)),
        # what was found stays what it is
        ((0, 12, 0, 0.0, False, False, True), False, {"foreign": 1}, (0, 16, 0, 0.0, False, False, True)),
        ((0, 12, 0, 0.0, False, True, False), True, {"foreign": 1}, (0, 16, 0, 0.0, False, True, False)),
        ((0, 12, 11, 0.0, False, False, True), False, {"doubled": 1}, (0, 11, 12, 0.0, False, True, True)),
        ((0, 14, 11, 0.0, False, False, True), False, {"doubled": 1}, (0, 13, 12, 0.0, False, True, True)),
        # healing: eight ticks, and nothing held against it any more
        ((3, 0, 0, 6 / 64, True, False, False), False, {}, (2, 0, 0, 7 / 64, True, False, False)),
        ((3, 0, 0, 7 / 64, True, False, False), False, {}, (2, 0, 0, 8 / 64, True, False, False)),
        ((1, 0, 0, 6 / 64, True, False, False), False, {}, (0, 0, 0, 7 / 64, True, False, False)),
        ((1, 3, 0, 7 / 64, True, False, False), False, {}, (0, 2, 0, 8 / 64, False, False, False)),
        ((1, 0, 0, 7 / 64, True, False, False), False, {}, CLEAN),
        ((0, 1, 0, 7 / 64, False, True, False), False, {}, CLEAN),
        ((0, 0, 1, 7 / 64, False, False, True), False, {}, CLEAN),
        ((0, 2, 0, 7 / 64, False, True, False), False, {}, (0, 1, 0, 8 / 64, False, True, False)),
        ((0, 0, 2, 7 / 64, False, False, True), False, {}, (0, 0, 1, 8 / 64, False, False, True)),
        ((2, 1, 1, 7 / 64, False, True, True), False, {}, (1, 0, 0, 8 / 64, False, False, False)),
        ((0, 1, 0, 6 / 64, False, True, False), False, {}, (0, 0, 0, 7 / 64, False, True, False)),
        ((0, 0, 0, 9 / 64, True, True, False), True, {}, (0, 0, 0, 0.0, True, True, False)),
        ((0, 0, 0, 2 / 64), False, {}, (0, 0, 0, 3 / 64, False, False, False)),
    ],
)  # fmt: skip
def test_one_tick_of_a_stream(judge, before, timed_out, health, after):
    stream = CLEAN._replace(**dict(zip(CLEAN._fields, before, strict=False)))
    assert judge(stream if any(before) else CLEAN, timed_out, **health) == after


@pytest.mark.parametrize("source", Source)
@pytest.mark.parametrize("odd", [{"bad": 1}, {"foreign": 1}, {"doubled": 1}])
def test_every_source_is_watched_from_the_first_odd_frame_on(parameters, source, odd):
    health = tuple(WELL._replace(**odd) if s is source else WELL for s in Source)
    streams = judge_streams(ALL_CLEAN, health, IN_TIME, parameters.supervision, 0.01)
    assert [s is not CLEAN for s in streams] == [s is source for s in Source]
    late = tuple(WELL._replace(age_s=0.09, fresh=False) if s is source else WELL for s in Source)
    assert judge_streams(ALL_CLEAN, late, IN_TIME, parameters.supervision, 0.01) is ALL_CLEAN


def test_healed_streams_are_the_clean_ones_again(parameters):
    """The same object, by which the rest of the law knows them."""
    p = replace(parameters.supervision, **LIMITS)
    streams = (CLEAN._replace(doubled=1, clean_s=1.0), *ALL_CLEAN[1:])
    assert judge_streams(streams, (WELL,) * len(Source), IN_TIME, p, 1 / 64) is ALL_CLEAN


def test_suspect_and_found():
    assert CLEAN == (0, 0, 0, 0.0, False, False, False)
    assert not CLEAN.suspect
    assert CLEAN._replace(foreign=1).suspect
    assert not CLEAN._replace(corrupted=True).foreign_found
    assert CLEAN._replace(second_sender=True).foreign_found
    assert CLEAN._replace(out_of_time=True).foreign_found

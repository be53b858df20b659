"""Progress of a stage, by a clock that the test sets."""

import pytest

from hil.diagnosis import progress


@pytest.fixture
def clock(monkeypatch):
    now_ns = [0]
    monkeypatch.setattr(progress, "monotonic_ns", lambda: now_ns[0])
    return now_ns


def _results(clock, seconds):
    for k, one in enumerate(seconds):
        clock[0] += round(one * 1e9)
        yield k


def test_a_long_stage_says_how_much_is_done_and_when_the_rest_will_be(clock):
    lines = []
    found = list(progress.counted(lines.append, "fits", _results(clock, [1.5, 1.5, 1.5, 1.5]), 4))
    assert found == [0, 1, 2, 3]
    assert lines == ["fits: 2 of 4, about 3 s left"]


def test_a_short_stage_says_nothing(clock):
    lines = []
    assert list(progress.counted(lines.append, "fits", _results(clock, [0.1] * 10), 10)) == list(range(10))
    assert not lines


def test_the_whole_is_foreseen_by_the_first_replays():
    assert progress.expectation(100, 2_000_000_000, (600, 5000)) == "20 ms a replay: expect 12 to 100 s in all"

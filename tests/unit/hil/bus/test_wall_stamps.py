"""Stamps in the time of day, whatever is done to that."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.wall_stamps import WallStamps

MS = 1_000_000
SLACK_NS = MS
HOUR_NS = 3_600_000 * MS


class Clocks:
    """Two clocks of a machine; reading takes time."""

    def __init__(self):
        self.now_ns, self.ahead_ns = 10**15, 1_700_000_000 * 10**9

    def monotonic(self):
        self.now_ns += 100
        return self.now_ns

    def wall(self):
        return self.monotonic() + self.ahead_ns


@pytest.fixture
def clocks():
    return Clocks()


def stamps_of(clocks):
    return WallStamps(clocks.monotonic, clocks.wall, SLACK_NS)


@pytest.mark.parametrize("step_ns", [HOUR_NS, -HOUR_NS])
@pytest.mark.parametrize("step_after", range(5))
def test_a_step_of_an_hour_moves_no_stamp(clocks, step_ns, step_after):
    """Four frames, a step before, among or after them, then four more."""
    stamps = stamps_of(clocks)
    for turn in range(2):
        arrived, stamped = [], []
        for number in range(5):
            if turn == 0 and number == step_after:
                clocks.ahead_ns += step_ns
            if number < 4:
                clocks.now_ns += 2 * MS
                arrived.append(clocks.now_ns)
                stamped.append(clocks.now_ns + clocks.ahead_ns)
        clocks.now_ns += MS
        stamps.look()
        assert [stamps.monotonic_of(s) for s in stamped] == pytest.approx(arrived, abs=1000)


def test_a_driver_that_fixed_the_time_of_day_when_it_opened_keeps_its_distances(clocks):
    stamps, opened_ahead_ns = stamps_of(clocks), clocks.ahead_ns
    for _ in range(5):
        clocks.ahead_ns -= HOUR_NS
        clocks.now_ns += 3 * MS
        arrived_ns = clocks.now_ns
        clocks.now_ns += 3 * MS
        stamps.look()
        assert stamps.monotonic_of(arrived_ns + opened_ahead_ns) == pytest.approx(arrived_ns, abs=1000)


def test_after_a_short_step_the_error_lasts_one_look(clocks):
    stamps = stamps_of(clocks)
    clocks.ahead_ns -= 5 * MS
    for turn in range(3):
        clocks.now_ns += 10 * MS
        arrived_ns = clocks.now_ns
        stamps.look()
        error_ns = abs(stamps.monotonic_of(arrived_ns + clocks.ahead_ns) - arrived_ns)
        assert error_ns <= (5 * MS + 1000 if turn == 0 else 1000)


def test_stamps_that_count_from_elsewhere_become_the_time_they_were_read(clocks):
    stamps = stamps_of(clocks)
    now_ns = stamps.look()
    assert [stamps.monotonic_of(stamp) for stamp in (0, -1, 12_500 * MS, 2**63)] == [now_ns] * 4


def test_a_thread_that_loses_the_processor_between_two_readings_moves_no_stamp(clocks):
    lost = [50 * MS, 0, 0]

    def wall():
        clocks.now_ns += lost.pop() if lost else 0
        return clocks.wall()

    lost.reverse()
    stamps = WallStamps(clocks.monotonic, wall, SLACK_NS)
    lost[:] = [0, 70 * MS]
    arrived_ns = clocks.now_ns
    stamped = arrived_ns + clocks.ahead_ns
    stamps.look()
    assert stamps.monotonic_of(stamped) == pytest.approx(arrived_ns, abs=1000)


EVENT = st.one_of(
    st.tuples(st.just("pass"), st.integers(0, 30 * MS)),
    st.tuples(st.just("frame"), st.just(0)),
    st.tuples(st.just("look"), st.just(0)),
    st.tuples(st.just("step"), st.integers(-2 * HOUR_NS, 2 * HOUR_NS)),
    st.tuples(st.just("slew"), st.integers(-5000, 5000)),
)


@given(st.lists(EVENT, max_size=60))
def test_whatever_happens_stamps_keep_order_and_stay_where_the_frames_came(events):
    clocks = Clocks()
    stamps = stamps_of(clocks)
    looked_ns, last_ns, waiting = clocks.now_ns, 0, []
    for kind, value in [*events, ("look", 0)]:
        if kind == "pass":
            clocks.now_ns += value
        elif kind == "frame":
            waiting.append(clocks.monotonic() + clocks.ahead_ns)
        elif kind == "look":
            now_ns = stamps.look()
            for stamp in waiting:
                time_ns = stamps.monotonic_of(stamp)
                assert max(looked_ns - SLACK_NS, last_ns) <= time_ns <= now_ns
                last_ns = time_ns
            waiting, looked_ns = [], now_ns
        else:
            clocks.ahead_ns += value

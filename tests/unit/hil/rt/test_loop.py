from itertools import islice

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc.frame import BusName, Frame
from hil.rt.clock import VirtualClock, WallClock
from hil.rt.loop import GRID_NS, Loop, Tick, run_node

MS = 1_000_000


class Oversleeper:
    """A clock that comes back late by a script: one entry per sleep, then punctual."""

    def __init__(self, late_ns, now_ns=0):
        self.now = now_ns
        self.late_ns = list(late_ns)

    def now_ns(self):
        return self.now

    def sleep_until(self, deadline_ns):
        if deadline_ns > self.now:
            self.now = deadline_ns + (self.late_ns.pop(0) if self.late_ns else 0)

    def work(self, duration_ns):
        self.now += duration_ns


def test_deadlines_lie_on_the_grid_of_the_clock():
    clock = VirtualClock(now_ns=7 * GRID_NS + 1)
    for k, tick in enumerate(islice(Loop(clock, 10 * MS, 3 * MS).ticks(), 1000)):
        assert tick == Tick(k, 3 * MS + k * 10 * MS, 0, 0)
        assert clock.now_ns() == 8 * GRID_NS + tick.now_ns


def test_started_on_the_grid_it_starts_at_once():
    clock = VirtualClock(now_ns=2 * GRID_NS)
    next(Loop(clock, 10 * MS).ticks())
    assert clock.now_ns() == 2 * GRID_NS


def test_two_loops_started_apart_keep_their_phase():
    one, other = VirtualClock(123), VirtualClock(123 + 777 * MS)
    next(Loop(one, 10 * MS, 2 * MS).ticks())
    next(Loop(other, 10 * MS, 5 * MS).ticks())
    assert (other.now_ns() - one.now_ns()) % (10 * MS) == 3 * MS


def test_a_late_waking_is_reported_and_moves_nothing():
    clock = Oversleeper([0, 4 * MS, 0])
    ticks = Loop(clock, 10 * MS).ticks()
    assert [next(ticks) for _ in range(3)] == [Tick(0, 0, 0, 0), Tick(1, 10 * MS, 0, 0), Tick(2, 20 * MS, 4 * MS, 0)]
    assert next(ticks) == Tick(3, 30 * MS, 0, 0)


def test_missed_ticks_are_skipped_and_counted():
    clock = Oversleeper([0, 35 * MS, 0, 0])
    loop = Loop(clock, 10 * MS, phase_ns=1 * MS)
    ticks = loop.ticks()
    assert next(ticks) == Tick(0, 1 * MS, 0, 0)
    assert next(ticks) == Tick(4, 41 * MS, 35 * MS, 3)  # 11, 21, 31 were missed, 41 is served 5 ms late
    assert clock.now_ns() == 46 * MS
    assert next(ticks) == Tick(5, 51 * MS, 0, 0)
    assert loop.overruns == 3


def test_slow_work_is_an_overrun_too():
    clock = Oversleeper([])
    loop = Loop(clock, 10 * MS)
    ticks = loop.ticks()
    next(ticks)
    clock.work(25 * MS)
    assert next(ticks) == Tick(2, 20 * MS, 15 * MS, 1)
    clock.work(1 * MS)
    assert next(ticks) == Tick(3, 30 * MS, 0, 0)
    assert loop.overruns == 1


def test_exactly_one_period_late_skips_exactly_one():
    assert next(Loop(Oversleeper([10 * MS], now_ns=-GRID_NS + 1), 10 * MS).ticks()) == Tick(1, 10 * MS, 10 * MS, 1)


@given(
    period_ns=st.integers(1, 50 * MS),
    phase_ns=st.integers(0, 50 * MS),
    start_ns=st.integers(0, 10**15),
    late_ns=st.lists(st.integers(0, 200 * MS), max_size=30),
    work_ns=st.lists(st.integers(0, 200 * MS), min_size=30, max_size=30),
)
def test_neither_drift_nor_burst_whatever_happens(period_ns, phase_ns, start_ns, late_ns, work_ns):
    clock = Oversleeper(late_ns, start_ns)
    loop = Loop(clock, period_ns, phase_ns)
    epoch_ns = -(-start_ns // GRID_NS) * GRID_NS
    before, skipped = -1, 0
    for tick, work in zip(loop.ticks(), work_ns, strict=False):
        deadline_ns = epoch_ns + tick.now_ns
        assert tick.now_ns == phase_ns + tick.number * period_ns
        assert deadline_ns <= clock.now_ns() < deadline_ns + period_ns  # always the newest deadline that has passed
        assert tick.number == before + 1 + tick.skipped
        assert tick.lateness_ns == clock.now_ns() - deadline_ns + tick.skipped * period_ns
        before, skipped = tick.number, skipped + tick.skipped
        assert loop.overruns == skipped
        clock.work(work)


def test_in_wall_time_it_is_never_early():
    clock = WallClock()
    began_ns = clock.now_ns()
    epoch_ns = -(-began_ns // GRID_NS) * GRID_NS
    for tick in islice(Loop(clock, 1 * MS).ticks(), 20):
        assert clock.now_ns() >= epoch_ns + tick.now_ns


@pytest.mark.parametrize(("period_ns", "phase_ns"), [(0, 0), (-1, 0), (1, -1)])
def test_impossible_timing_is_refused(period_ns, phase_ns):
    with pytest.raises(ValueError, match="expected period > 0 and phase >= 0"):
        Loop(VirtualClock(), period_ns, phase_ns)


def test_a_node_is_run_once_a_tick_with_what_arrived():
    frames = [Frame(BusName.VEHICLE, n, b"") for n in range(4)]
    calls, sent = [], []

    class Echo:
        def step(self, now_ns, inbox):
            calls.append((now_ns, inbox))
            return inbox

    arrived = [[frames[0]], [], frames[1:]]

    class ScriptedPort:
        def receive(self):
            return arrived.pop(0)

        def send(self, frames):
            sent.append(frames)

    ticks = []
    for tick in run_node(Echo(), ScriptedPort(), Loop(VirtualClock(), 10 * MS, 4 * MS)):
        ticks.append(tick)
        assert len(sent) == len(ticks)  # sent before the caller hears of the tick
        if len(ticks) == 3:
            break
    assert calls == [(4 * MS, [frames[0]]), (14 * MS, []), (24 * MS, frames[1:])]
    assert sent == [[frames[0]], [], frames[1:]]

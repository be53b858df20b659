"""What every clock promises."""

import pytest

from hil.rt.clock import VirtualClock, WallClock, clocks_ns, monotonic_ns

CLOCKS = {"wall": WallClock, "spinning": lambda: WallClock(spin_ns=200_000), "virtual": lambda: VirtualClock(10**12)}


@pytest.fixture(params=CLOCKS)
def clock(request):
    return CLOCKS[request.param]()


def test_it_never_runs_backwards(clock):
    seen = []
    for ahead_ns in (1_000, -1_000_000, 100_000, 0):
        clock.sleep_until(clock.now_ns() + ahead_ns)
        seen.append(clock.now_ns())
    assert seen == sorted(seen)


@pytest.mark.parametrize("ahead_ns", [1, 999, 50_000, 1_000_001, 3_333_333])
def test_a_sleep_never_ends_early(clock, ahead_ns):
    deadline_ns = clock.now_ns() + ahead_ns
    clock.sleep_until(deadline_ns)
    assert clock.now_ns() >= deadline_ns


def test_virtual_time_passes_by_sleeping_only():
    clock = VirtualClock(5)
    assert [clock.now_ns(), clock.now_ns()] == [5, 5]
    clock.sleep_until(1_000)
    assert clock.now_ns() == 1_000
    clock.sleep_until(10)
    assert clock.now_ns() == 1_000


def test_the_wall_clock_is_the_one_frames_are_stamped_with():
    before_ns = monotonic_ns()
    assert before_ns <= WallClock().now_ns() <= monotonic_ns()


def test_both_clocks_are_read_together_or_again():
    now_ns, lost_ns = 0, [0, 70_000_000]  # the processor, in the first reading

    def monotonic():
        nonlocal now_ns
        now_ns += 100
        return now_ns

    def wall():
        nonlocal now_ns
        now_ns += lost_ns.pop() if lost_ns else 0
        return monotonic() + 5_000

    at_ns, ahead_ns = clocks_ns(monotonic, wall)
    assert at_ns == now_ns
    assert ahead_ns == 5_000

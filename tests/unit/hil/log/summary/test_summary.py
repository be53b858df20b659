import dataclasses

import numpy as np
import pytest

from hil.log.frames import FrameFlag, FrameTable
from hil.log.summary.bus_time import BITS
from hil.log.summary.state import MAX_IDS, State, bin_edges, bins_of
from hil.log.summary.summary import Statistics

MS = 1_000_000
START = 1_700_000_000_000_000_000


def table(times, ids, channels=("can0",), **columns):
    frames = FrameTable.empty(len(times), channels=channels)
    frames.time_ns[:] = times
    frames.can_id[:] = ids
    frames.length[:] = 8
    for name, values in columns.items():
        getattr(frames, name)[:] = values
    return frames


def varied(seed, n=3000, ids=200):
    rng = np.random.default_rng(seed)
    times = START + np.cumsum(rng.integers(0, 3 * MS, n))
    times[rng.integers(0, n, 5)] -= rng.integers(0, 5_000 * MS, 5)
    return table(
        times,
        rng.integers(0, ids, n),
        channels=("can0", "can1", "can2"),
        channel=rng.integers(0, 3, n),
        extended=rng.random(n) < 0.2,
        length=rng.choice([0, 2, 7, 8, 8, 8, 12, 64], n),
        flags=rng.choice([0, 0, 0, 1, 2, 4, 12, 16, 32, 36], n),
    )


def counted(tables, fast, rates=lambda _: (None, None)):
    statistics = Statistics(rates, fast)
    for one in tables:
        statistics.add(one)
    return statistics


@pytest.mark.parametrize("seed", range(5))
def test_both_ways_count_the_same(seed):
    tables = [varied(seed), varied(seed + 50).take(slice(0, 1)), FrameTable.empty(), varied(seed + 100, ids=20_000)]
    compiled, plain = (counted(tables, fast, lambda _: (500_000, 2_000_000)) for fast in (True, False))
    assert compiled.result() == plain.result()
    for field in dataclasses.fields(State):
        if field.name != "places":
            mine, other = (getattr(one._state, field.name) for one in (compiled, plain))
            np.testing.assert_array_equal(mine, other, field.name)


@pytest.mark.parametrize("fast", [True, False])
def test_how_the_log_is_cut_into_tables_does_not_matter(fast):
    whole = varied(7)
    pieces = [whole.take(slice(a, a + 97)) for a in range(0, len(whole), 97)]
    assert counted([whole], fast).result() == counted(pieces, fast).result()


@pytest.mark.parametrize("fast", [True, False])
def test_cycle_times_and_the_one_gap(fast):
    times = START + np.arange(100) * 10 * MS
    times[60:] += 70 * MS
    summary = counted([table(times, 0x123)], fast).result(lambda *_: 10 * MS)
    (one,) = summary.ids
    assert (one.name, one.count, one.lengths, one.length_changes) == ("0x123", 100, (8,), 0)
    assert one.cycle.gaps == 1
    assert (one.cycle.min_ns, one.cycle.max_ns) == (10 * MS, 80 * MS)
    assert one.cycle.max_at_ns == START + 59 * 10 * MS
    assert one.cycle.p50_ns == 10 * MS
    assert one.cycle.mean_ns == pytest.approx((990 + 70) / 99 * MS)
    assert counted([table(times, 0x123)], fast).result().ids[0].cycle.gaps == 1  # by the median as well


def test_an_identifier_that_comes_at_random_has_no_gaps():
    rng = np.random.default_rng(3)
    times = START + np.cumsum(rng.exponential(50 * MS, 500).astype(np.int64))
    assert counted([table(times, 1)], False).result().ids[0].cycle.gaps is None


@pytest.mark.parametrize("fast", [True, False])
def test_stamps_running_back_name_the_frame(fast):
    times = START + np.array([0, 10, 5, 20, 15]) * MS
    summary = counted([table(times, [1, 2, 1, 1, 1])], fast).result()
    assert (summary.backwards.count, summary.backwards.frame) == (2, 3)
    assert summary.backwards.time_ns == START + 5 * MS
    assert [one.backwards and (one.backwards.count, one.backwards.frame) for one in summary.ids] == [(1, 5), None]


@pytest.mark.parametrize("fast", [True, False])
def test_bus_load_of_the_worst_second(fast):
    # 135 bits each (8 bytes, 11-bit identifier, worst stuffing): 1000 in the first second, 2000 in the next
    times = np.concatenate((np.arange(1000) * MS, 1000 * MS + np.arange(2001) * MS // 2)) + START
    (channel,) = counted([table(times, 1)], fast, lambda _: (500_000, None)).result().channels
    assert channel.worst_load == pytest.approx(2000 * 135 / 500_000)
    assert channel.worst_at_ns == START + 1000 * MS
    assert channel.load == pytest.approx(3001 * 135 / 500_000 / 2)
    (unknown,) = counted([table(times, 1)], fast).result().channels
    assert unknown.load is None
    assert unknown.worst_bits_per_s == pytest.approx(2000 * 135)
    assert unknown.bits_per_s == pytest.approx(3001 * 135 / 2)


def test_bits_of_a_frame_are_those_of_the_standard():
    assert BITS[0, 8].tolist() == [135, 0]
    assert BITS[4, 8].tolist() == [160, 0]
    assert BITS[1, 8].tolist() == [55, 0]  # a remote frame has no data
    assert BITS[2, 64, 0] == 579 + (17 + 5 + 512 - 1) // 4
    assert BITS[3, 64].sum() == BITS[2, 64, 0]


@pytest.mark.parametrize("fast", [True, False])
def test_identifiers_beyond_the_limit_are_counted_together(fast):
    n = MAX_IDS + 100
    summary = counted([table(START + np.arange(n), np.arange(n), extended=True)], fast).result()
    assert len(summary.ids) == MAX_IDS
    assert summary.other_frames == 100


@pytest.mark.parametrize("fast", [True, False])
def test_remote_and_error_frames_do_not_count_as_cycles(fast):
    flags = [0, FrameFlag.REMOTE, FrameFlag.ERROR, 0]
    summary = counted([table(START + np.arange(4) * MS, 1, flags=flags)], fast).result()
    (one,) = summary.ids
    assert (one.count, one.remote, one.cycle.max_ns) == (3, 1, 3 * MS)
    assert (summary.channels[0].frames, summary.channels[0].errors, summary.channels[0].remote) == (4, 1, 1)


@pytest.mark.parametrize("fast", [True, False])
def test_stamps_at_the_ends_of_64_bits_end_well(fast):
    times = np.array([-(2**63), 2**63 - 1, 0, 2**63 - 1, -(2**63)])
    with np.errstate(over="ignore"):
        summary = counted([table(times, 1)], fast).result()
    assert summary.frames == 5


def test_an_empty_log():
    summary = counted([FrameTable.empty()], None).result()
    assert (summary.frames, summary.duration_s, summary.ids, summary.channels) == (0, 0.0, (), ())


def test_every_interval_falls_between_the_edges_of_its_bin():
    edges = bin_edges()
    values = np.unique(np.geomspace(1_000, 1e12, 5000).astype(np.int64))
    bins = bins_of(values)
    assert (edges[bins] <= values).all()
    assert (values < edges[bins + 1]).all()
    assert (np.diff(edges) / edges[:-1]).max() < 0.008


@pytest.mark.parametrize("fast", [False, True])
def test_the_worst_second_is_not_below_the_mean(fast):
    # 151 frames in 1.5 s: a hundred in the first whole second, one more at the end of both
    times = START + np.arange(151) * 10 * MS
    channel = counted([table(times, 0x123)], fast, lambda _: (500_000, None)).result().channels[0]
    assert channel.load == pytest.approx(151 * 135 / 500_000 / 1.5)
    assert channel.worst_load == channel.load

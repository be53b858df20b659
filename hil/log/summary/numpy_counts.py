"""Counts frames for the summary with numpy alone, as `hil.log.summary.compiled_counts` does, in small logs."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameFlag, FrameTable
from hil.log.summary.bus_time import BITS, kinds
from hil.log.summary.state import CODES, MAX_IDS, Channel, Id, Ints, State, Whole, bins_of

_SECOND = 1_000_000_000


def count_rows(table: FrameTable, state: State, places: dict[int, int]) -> None:
    """Count the rows of one table.

    Parameters
    ----------
    places : rows of ``state.ids`` by key, kept by the caller.
    """
    n = len(table)
    if not n:
        return
    before = _count_order(table, state.whole)
    for number in np.unique(table.channel).tolist():
        _count_channel(table, np.flatnonzero(table.channel == number), state, number)
    rows = np.flatnonzero((table.flags & FrameFlag.ERROR) == 0)
    if not len(rows):
        return
    key = table.channel[rows].astype(np.int64) << 32 | table.can_id[rows]
    key |= table.extended[rows].astype(np.int64) << 31
    order = np.argsort(key, kind="stable")
    rows, key = rows[order], key[order]
    bounds = [0, *(np.flatnonzero(np.diff(key)) + 1).tolist(), len(key)]
    groups = sorted(((rows[a:b], int(key[a])) for a, b in pairwise(bounds)), key=lambda group: int(group[0][0]))
    for group, one_key in groups:
        row = places.get(one_key)
        if row is None:
            row = int(state.whole[Whole.IDS])
            if row >= MAX_IDS:
                state.whole[Whole.OTHER] += len(group)
                continue
            state.whole[Whole.IDS] += 1
            state.keys[row] = one_key
            places[one_key] = row
        _count_id(table.take(group), group + before + 1, state.ids[row], state.intervals[row])


def _count_order(table: FrameTable, whole: Ints) -> int:
    """Count what concerns the log as a whole; return the number of frames before this table."""
    times = table.time_ns
    before = int(whole[Whole.FRAMES])
    if before == 0:
        whole[[Whole.FIRST, Whole.LEAST, Whole.GREATEST, Whole.PREVIOUS]] = times[0]
    previous = np.concatenate((whole[[Whole.PREVIOUS]], times[:-1]))
    back = np.flatnonzero(times < previous)
    if len(back) and whole[Whole.BACK] == 0:
        whole[Whole.BACK_FRAME] = before + back[0] + 1
        whole[Whole.BACK_NS], whole[Whole.BACK_FROM] = times[back[0]], previous[back[0]]
    whole[Whole.BACK] += len(back)
    whole[Whole.FRAMES] += len(times)
    whole[Whole.PREVIOUS] = times[-1]
    whole[Whole.LEAST] = min(whole[Whole.LEAST], times.min())
    whole[Whole.GREATEST] = max(whole[Whole.GREATEST], times.max())
    return before


def _count_channel(table: FrameTable, rows: Ints, state: State, number: int) -> None:
    of, bit_ps = state.channels[number], state.bit_ps[number]
    times, flags = table.time_ns[rows], table.flags[rows]
    first = int(state.whole[Whole.FIRST])
    if of[Channel.FRAMES] == 0:
        of[[Channel.LEAST, Channel.GREATEST]] = times[0]
        of[Channel.SECOND] = (times[0] - first) // _SECOND
    of[Channel.FRAMES] += len(rows)
    of[Channel.LEAST] = min(of[Channel.LEAST], times.min())
    of[Channel.GREATEST] = max(of[Channel.GREATEST], times.max())
    of[Channel.SENT] += np.count_nonzero(flags & FrameFlag.SENT)
    good = (flags & FrameFlag.ERROR) == 0
    of[Channel.ERRORS] += len(rows) - np.count_nonzero(good)
    rows, times, flags = rows[good], times[good], flags[good]
    remote = (flags & FrameFlag.REMOTE) != 0
    flexible = (flags & FrameFlag.FD) != 0
    of[Channel.REMOTE] += np.count_nonzero(remote)
    of[Channel.FD] += np.count_nonzero(flexible)
    of[Channel.SWITCHED] += np.count_nonzero(flexible & ~remote & ((flags & FrameFlag.BIT_RATE_SWITCH) != 0))
    busy = BITS[kinds(table.extended[rows], flags), table.length[rows]] @ bit_ps
    of[Channel.BUSY] += busy.sum()
    seconds = (times - first) // _SECOND
    bounds = [0, *(np.flatnonzero(np.diff(seconds)) + 1).tolist(), len(seconds)]
    for a, b in pairwise(bounds) if len(seconds) else ():
        second = int(seconds[a])
        if second != of[Channel.SECOND] and second != of[Channel.SECOND] - 1:
            of[Channel.SECOND], of[Channel.SECOND_BUSY] = second, 0
        of[Channel.SECOND_BUSY] += busy[a:b].sum()
        if of[Channel.SECOND_BUSY] > of[Channel.WORST_BUSY]:
            of[Channel.WORST_BUSY], of[Channel.WORST] = of[Channel.SECOND_BUSY], of[Channel.SECOND]


def _count_id(frames: FrameTable, numbers: Ints, one: Ints, histogram: npt.NDArray[np.uint32]) -> None:
    """Count the frames of one identifier; ``numbers`` are theirs in the whole log, from 1."""
    if one[Id.COUNT] == 0:
        one[Id.FIRST] = frames.time_ns[0]
    one[Id.COUNT] += len(frames)
    one[Id.LAST] = frames.time_ns[-1]
    one[Id.SENT] += np.count_nonzero(frames.flags & FrameFlag.SENT)
    one[Id.FD] += np.count_nonzero(frames.flags & FrameFlag.FD)
    data = (frames.flags & FrameFlag.REMOTE) == 0
    one[Id.REMOTE] += len(frames) - np.count_nonzero(data)
    times, lengths, numbers = frames.time_ns[data], frames.length[data].astype(np.int64), numbers[data]
    if not len(times):
        return
    one[Id.LENGTHS] |= np.bitwise_or.reduce(np.int64(1) << CODES[lengths])
    if one[Id.DATA] > 0:
        earlier = np.concatenate((one[[Id.PREVIOUS]], times[:-1]))
        one[Id.LENGTH_CHANGES] += np.count_nonzero(np.diff(lengths, prepend=one[Id.LENGTH]))
        later, numbers = times, numbers
    else:
        earlier, later, numbers = times[:-1], times[1:], numbers[1:]
        one[Id.LENGTH_CHANGES] += np.count_nonzero(np.diff(lengths))
    one[Id.DATA] += len(times)
    one[Id.LENGTH], one[Id.PREVIOUS] = lengths[-1], times[-1]
    interval = later - earlier
    back = np.flatnonzero(interval < 0)
    if len(back):
        if one[Id.BACK] == 0:
            one[Id.BACK_FRAME], one[Id.BACK_NS] = numbers[back[0]], later[back[0]]
        one[Id.BACK] += len(back)
        earlier, interval = earlier[interval >= 0], interval[interval >= 0]
    if not len(interval):
        return
    none = one[Id.INTERVALS] == 0
    longest = int(interval.argmax())
    if none or interval[longest] > one[Id.MAX]:
        one[Id.MAX], one[Id.MAX_AT] = interval[longest], earlier[longest]
    if none or interval.min() < one[Id.MIN]:
        one[Id.MIN] = interval.min()
    one[Id.INTERVALS] += len(interval)
    one[Id.SUM] += interval.sum()
    found, counts = np.unique(bins_of(interval), return_counts=True)
    histogram[found] += counts.astype(np.uint32)

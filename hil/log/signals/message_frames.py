"""Frames of one message, as they are in a table and as transport frames carried them."""

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameTable
from hil.log.signals.assign import Assigned
from hil.log.signals.extract import Group
from hil.log.signals.j1939 import Joined
from hil.log.signals.signal_plan import MessagePlan, Words


def stamps_of(
    time_ns: npt.NDArray[np.int64], assigned: Assigned, came: npt.NDArray[np.int64]
) -> dict[int, tuple[int, int]]:
    """Least and greatest stamp of the frames of each slot."""
    if not len(came):
        return {}
    begins, ends = assigned.starts[came], assigned.starts[came + 1]
    if assigned.ascending:
        least, greatest = time_ns[assigned.rows[begins]], time_ns[assigned.rows[ends - 1]]
    else:
        times = time_ns[assigned.rows[: assigned.starts[-2]]]
        least, greatest = np.minimum.reduceat(times, begins), np.maximum.reduceat(times, begins)
    return dict(zip(came.tolist(), zip(least.tolist(), greatest.tolist(), strict=True), strict=True))


def words_of(table: FrameTable) -> Words:
    """Payloads as words, as many a frame as its row of data has."""
    data = table.data
    if data.shape[1] % 8:
        data = np.pad(data, ((0, 0), (0, -data.shape[1] % 8)))
    return np.ascontiguousarray(data).reshape(-1).view("<u8").astype(np.uint64, copy=False)


def frames_of(
    plan: MessagePlan, table: FrameTable, words: Words, assigned: Assigned, begin: int, end: int, least: int
) -> tuple[Group, int]:
    """Frames of a message that hold a signal, and how many do not.

    Parameters
    ----------
    begin, end : where its frames are in the order of ``assigned``.
    least : bytes of the shortest of them.
    """
    group = Group(assigned.rows[begin:end], None, words, len(words) // len(table))
    group.put_plane(assigned.first[begin:end], begin)
    if least >= plan.full:
        return group, 0
    group.lengths = table.length[group.rows]
    if least >= plan.least:
        return group, 0
    group = group.take(np.flatnonzero(group.lengths >= plan.least))
    return group, end - begin - len(group.rows)


def with_joined(group: Group, joined: list[Joined], table: FrameTable, words: Words) -> Group:
    """Frames of a message and those that transport frames carried, in the order of the log."""
    padded = [one.data.ljust(-(-len(one.data) // 8) * 8, b"\0") for one in joined]
    further = np.frombuffer(b"".join(padded), "<u8").astype(np.uint64)
    begins = np.concatenate(([0], np.cumsum([len(one) // 8 for one in padded])))[:-1].astype(np.int64)
    stride = len(words) // len(table)
    own = words.reshape(-1, stride)[group.rows].reshape(-1)
    rows = np.concatenate((group.rows, np.array([one.row for one in joined], np.int64)))
    at = np.concatenate((np.arange(len(group.rows)) * stride, begins + len(own)))
    sizes = np.array([len(one.data) for one in joined], np.int64)
    lengths = np.concatenate((table.length[group.rows].astype(np.int64), sizes))
    order = np.argsort(rows, kind="stable")
    return Group(rows[order], lengths[order], np.concatenate((own, further)), stride, at[order])

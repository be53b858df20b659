"""Merges the frames of several groups by time, in bounded memory; frames of one group keep their order."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from hil.log.builder import ROWS
from hil.log.frames import FrameTable

Keys = npt.NDArray[np.int64]
LEAST = -(2**63)


def keys_of(table: FrameTable, after: int) -> Keys:
    """What frames are merged by: the latest stamp of their group so far: one that runs back stays in place."""
    keys: Keys = np.maximum.accumulate(np.maximum(table.time_ns, after))
    return keys


class _Head:
    """What was read of one group and is not merged yet."""

    def __init__(self, tables: Iterator[FrameTable]) -> None:
        self.tables = tables
        self.table = FrameTable.empty()
        self.keys: Keys = np.zeros(0, np.int64)
        self.latest = LEAST
        self.first = 0  # least key that is held
        self.ended = False

    @property
    def held(self) -> int:
        """Number of frames."""
        return len(self.keys)

    def read(self, least: int) -> None:
        """Read on until ``least`` frames are there, or there are no more."""
        n = self.held
        if n > least or self.ended:
            return
        parts = [self.table] if n else []
        keys = [self.keys]
        while n <= least and not self.ended:
            table = next(self.tables, None)
            if table is None:
                self.ended = True
            elif len(table):
                parts.append(table)
                keys.append(keys_of(table, self.latest))
                self.latest = int(keys[-1][-1])
                n += len(table)
        if len(keys) > 1:
            self.table, self.keys = FrameTable.joined(parts, ()), np.concatenate(keys)
            self.first = int(self.keys[0])

    def take(self, n: int) -> FrameTable:
        """Give the first frames away."""
        taken = self.table.take(slice(0, n))
        self.table, self.keys = self.table.take(slice(n, None)), self.keys[n:]
        self.first = int(self.keys[0]) if len(self.keys) else 0
        return taken


def merged(groups: Sequence[Iterable[FrameTable]], rows: int) -> Iterator[FrameTable]:
    """Yield the frames of groups by time; equal stamps in the order of the groups.

    Parameters
    ----------
    rows : frames of a group that are read at once.
    """
    heads = [_Head(iter(group)) for group in groups]
    if len(heads) == 1:
        yield from heads[0].tables
        return
    while True:
        for head in heads:
            head.read(rows // 2)
        heads = [head for head in heads if head.held]
        if not heads:
            return
        open_ends = [(head.latest, k) for k, head in enumerate(heads) if not head.ended]
        limit, first = min(open_ends, default=(2**63 - 1, len(heads)))
        parts, keys = [], []
        for k, head in enumerate(heads):
            if head.first > limit or (head.first == limit and k > first):
                continue
            n = int(np.searchsorted(head.keys, limit, side="right" if k <= first else "left"))
            keys.append(head.keys[:n])
            parts.append(head.take(n))
        order = np.argsort(np.concatenate(keys), kind="stable")
        table = FrameTable.joined(parts, ())
        for begin in range(0, len(table), ROWS):
            yield table.take(order[begin : begin + ROWS])


class Reordering:
    """Sorts by time the frames of groups that were written into one stream, as far as ``rows`` frames reach.

    Parameters
    ----------
    rows : frames that are held back.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self.latest: dict[int, int] = {}
        self.tables: list[FrameTable] = []
        self.keys: list[Keys] = []
        self.groups: list[npt.NDArray[np.int32]] = []
        self.held = 0

    def add(self, table: FrameTable, group: int) -> None:
        """Add frames of a group."""
        if not len(table):
            return
        keys = keys_of(table, self.latest.get(group, LEAST))
        self.latest[group] = int(keys[-1])
        self.tables.append(table)
        self.keys.append(keys)
        self.groups.append(np.full(len(table), group, np.int32))
        self.held += len(table)

    def take(self, last: bool) -> Iterator[FrameTable]:
        """Give the earlier half once there are enough, or all at the ``last`` call."""
        if not self.held or (self.held < self.rows and not last):
            return
        keys, groups = np.concatenate(self.keys), np.concatenate(self.groups)
        order = np.lexsort((groups, keys))
        table = FrameTable.joined(self.tables, ())
        n = self.held if last else self.held // 2
        rest = order[n:]
        self.tables, self.keys, self.groups = [table.take(rest)], [keys[rest]], [groups[rest]]
        self.held = len(rest)
        for begin in range(0, n, ROWS):
            yield table.take(order[begin : min(n, begin + ROWS)])

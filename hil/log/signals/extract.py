"""Signals of one message at a time: which frames hold each signal, and the values there."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hil.log.signals.decoded import Rows, Values
from hil.log.signals.signal_plan import MessagePlan, SignalPlan, Words

Lengths = npt.NDArray[np.integer]


@dataclass(slots=True, eq=False)
class Group:
    """Frames of one message.

    Attributes
    ----------
    rows : their row numbers, ascending.
    lengths : their data bytes; None where each holds every signal.
    buffer, at : words of payloads, and where each frame's begin; None where each row has ``stride`` words.
    """

    rows: Rows
    lengths: Lengths | None
    buffer: Words
    stride: int = 1
    at: Rows | None = None
    begin: int | None = None
    _planes: dict[int, Words] = field(default_factory=dict)

    def plane(self, word: int) -> Words:
        """Return the given word of all frames, which must be long enough."""
        if word not in self._planes:
            at = self.rows * self.stride if self.at is None else self.at
            self._planes[word] = self.buffer[at + word]
        return self._planes[word]

    def put_plane(self, words: Words, begin: int | None = None) -> None:
        """Set the first word of all frames, where it is known already, and where the assigned words hold it."""
        self._planes[0] = words
        self.begin = begin

    def words(self, plan: SignalPlan) -> Words:
        """Words that hold a signal, see `SignalPlan.shift`."""
        first = self.plane(plan.word)
        return plan.joined(first, self.plane(plan.word + 1)) if plan.straddles else first

    def take(self, chosen: Rows) -> "Group":
        """Return the frames at these positions (ascending)."""
        lengths = None if self.lengths is None else self.lengths[chosen]
        at = None if self.at is None else self.at[chosen]
        group = Group(self.rows[chosen], lengths, self.buffer, self.stride, at)
        if 0 in self._planes:
            group.put_plane(self._planes[0][chosen])
        return group

    def cut(self, first: int, last: int, begin: int | None) -> "Group":
        """Return the frames at positions ``first`` to ``last``."""
        lengths = None if self.lengths is None else self.lengths[first:last]
        at = None if self.at is None else self.at[first:last]
        group = Group(self.rows[first:last], lengths, self.buffer, self.stride, at)
        if 0 in self._planes:
            group.put_plane(self._planes[0][first:last], begin)
        return group


class Found(NamedTuple):
    """One signal, given by its place in its message: values at ``rows``; ``n`` frames hold it, see `SignalCount`."""

    place: int
    rows: Rows
    values: Values
    n: int
    sna: int
    outside: int


class Piece(NamedTuple):
    """One signal, given by its place in its message, at the frames that hold it, and its words there.

    ``begin`` is where the assigned words hold these words; None where they do not.
    """

    place: int
    plan: SignalPlan
    rows: Rows
    words: Words
    begin: int | None


def pieces_of(plan: MessagePlan, group: Group) -> list[Piece]:
    """Frames (none, it may be) and words of each signal of a message that is kept.

    A multiplexer value that no signal lists selects none. Time is linear in what comes out: frames are sorted by the
    value of their multiplexer once.
    """
    there: dict[tuple[SignalPlan, ...] | SignalPlan, Group] = {}
    branches: dict[tuple[int, tuple[tuple[int, int], ...]], Group] = {}
    sorted_by: dict[int, tuple[Rows, Values]] = {}
    cut: dict[tuple[int, int], Group] = {}
    for signal in plan.signals:
        chain: list[SignalPlan] = []
        at: SignalPlan | None = signal
        while at is not None and at not in there:
            chain.append(at)
            at = at.parent
        for one in reversed(chain):
            base = group
            if one.parent is not None:
                branch = id(one.parent), one.ranges
                if branch not in branches:
                    branches[branch] = _selected(one.parent, there[one.parent], one.ranges, sorted_by)
                base = branches[branch]
            if base.lengths is not None:
                short = id(base), one.end
                if short not in cut:
                    cut[short] = base.take(np.flatnonzero(base.lengths >= one.end))
                base = cut[short]
            there[one] = base
    pieces = []
    for place, signal in enumerate(plan.signals):
        group = there[signal]
        if signal.kept:
            begin = group.begin if signal.word == 0 and not signal.straddles else None
            pieces.append(Piece(place, signal, group.rows, group.words(signal), begin))
    return pieces


def _selected(
    multiplexer: SignalPlan,
    group: Group,
    ranges: Sequence[tuple[int, int]],
    sorted_by: dict[int, tuple[Rows, Values]],
) -> Group:
    """Frames whose multiplexer has one of the values."""
    if id(multiplexer) not in sorted_by:
        raw = multiplexer.raw(group.words(multiplexer)) if len(group.rows) else np.zeros(0, np.int64)
        order = np.argsort(raw, kind="stable")
        sorted_by[id(multiplexer)] = order, raw[order]
    order, values = sorted_by[id(multiplexer)]
    low, high = (0, 2**64 - 1) if values.dtype == np.uint64 else (-(2**63), 2**63 - 1)
    kept = [(max(first, low), min(last, high)) for first, last in ranges if first <= high and last >= low]
    begins = np.searchsorted(values, np.array([first for first, _ in kept], values.dtype), "left")
    ends = np.searchsorted(values, np.array([last for _, last in kept], values.dtype), "right")
    runs = [order[a:b] for a, b in zip(begins.tolist(), ends.tolist(), strict=True) if a < b]
    if not runs:
        return group.take(np.zeros(0, np.int64))
    return group.take(np.sort(np.concatenate(runs)))


def work_out(piece: Piece) -> Found:
    """Values of a signal, by numpy."""
    plan, rows = piece.plan, piece.rows
    raw = plan.raw(piece.words)
    n, sna = len(raw), 0
    if plan.sna:
        there = ~np.isin(raw, np.array(plan.sna, raw.dtype))
        sna = n - int(np.count_nonzero(there))
        if sna:
            raw, rows = raw[there], rows[there]
    values = plan.physical(raw)
    outside = plan.outside(values)
    return Found(piece.place, rows, values, n, sna, outside - plan.named_among(piece.words) if outside else 0)

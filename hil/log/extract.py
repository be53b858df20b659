"""Signals of one message at a time: which frames hold each signal, and the values there."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hil.log.decoded import Rows, Values
from hil.log.signal_plan import FLOAT, OTHER, Ints, MessagePlan, SignalPlan, Words

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


@dataclass(slots=True, eq=False)
class Piece:
    """One signal at the frames that hold it, and its values once they are worked out.

    Attributes
    ----------
    begin : where the assigned words hold ``words``; None where they do not.
    rows : the frames, without those whose value is not available.
    n, sna, outside : frames, values not available, values out of range.
    """

    plan: SignalPlan
    words: Words
    rows: Rows
    begin: int | None = None
    values: Values = field(init=False)
    n: int = 0
    sna: int = 0
    outside: int = 0


def pieces_of(plan: MessagePlan, group: Group) -> list[Piece]:
    """Frames and words of each signal of a message that is kept.

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
    for signal in plan.signals:
        group = there[signal]
        if signal.kept and len(group.rows):
            begin = group.begin if signal.word == 0 and not signal.straddles else None
            pieces.append(Piece(signal, group.words(signal), group.rows, begin))
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


def work_out(piece: Piece) -> None:
    """Values of a signal, by numpy."""
    plan = piece.plan
    raw = plan.raw(piece.words)
    piece.n = len(raw)
    if plan.sna:
        there = ~np.isin(raw, np.array(plan.sna, raw.dtype))
        piece.sna = piece.n - int(np.count_nonzero(there))
        if piece.sna:
            raw, piece.rows = raw[there], piece.rows[there]
    piece.values = plan.physical(raw)
    piece.outside = plan.outside(piece.values)


def work_out_all(parts: Sequence[tuple[MessagePlan, Sequence[Piece]]], fast: bool, base: Words) -> None:
    """Values of all signals; the compiled pass takes what it can.

    ``base`` holds the words of the pieces that have a ``begin``.
    """
    compiled: list[Piece] = []
    numbers: list[int] = []
    ints: list[Ints] = []
    before = 0
    for plan, pieces in parts:
        index = {id(s): i for i, s in enumerate(plan.signals)}
        ints.append(plan.ints)
        for piece in pieces:
            if fast and piece.plan.kind != OTHER:
                compiled.append(piece)
                numbers.append(before + index[id(piece.plan)])
            else:
                work_out(piece)
        before += len(plan.signals)
    if not compiled:
        return
    _compiled(compiled, numbers, np.concatenate(ints), np.concatenate([p.floats for p, _ in parts]), base)


def _compiled(
    pieces: list[Piece], numbers: list[int], ints: Ints, floats: npt.NDArray[np.float64], base: Words
) -> None:
    from hil.log.decode_pass import extract

    jobs = np.zeros((len(pieces), 4), np.int64)
    jobs[:, 0] = numbers
    jobs[:, 2] = sizes = [len(p.words) for p in pieces]
    jobs[1:, 3] = np.cumsum(sizes)[:-1]
    out = np.empty(int(sum(sizes)), np.int64)
    as_float = out.view(np.float64)
    counts = np.zeros((len(pieces), 2), np.int64)
    scratch = np.zeros(1024, np.int64)
    further: dict[int, int] = {}  # words outside of the base, each once
    extra: list[Words] = []
    size = 0
    in_base, begins = [False] * len(pieces), [0] * len(pieces)
    for i, piece in enumerate(pieces):
        words = piece.words
        if piece.begin is not None:
            begins[i] = piece.begin
            in_base[i] = True
            continue
        if id(words) not in further:
            further[id(words)] = size
            extra.append(words)
            size += len(words)
        begins[i] = further[id(words)]
    jobs[:, 1] = begins
    inside = np.array(in_base)
    for pool, chosen in ((base, inside), (np.concatenate([*extra, base[:0]]), ~inside)):
        some = np.flatnonzero(chosen)
        if not len(some):
            continue
        found = np.zeros((len(some), 2), np.int64)
        done = extract(pool.view(np.int64), jobs[some], ints, floats, out, as_float, found, scratch)
        if done != len(some):
            raise AssertionError(f"signal {done} of {len(some)} lies outside of its frames")
        counts[some] = found
    for piece, (_, _, n, at), (absent, bad) in zip(pieces, jobs.tolist(), counts.tolist(), strict=True):
        piece.n, piece.sna, piece.outside = n, absent, bad
        piece.values = (as_float if piece.plan.kind == FLOAT else out)[at : at + n]
        if absent:
            there = piece.plan.raw(piece.words) != piece.plan.sna[0]
            piece.values, piece.rows = piece.values[there], piece.rows[there]

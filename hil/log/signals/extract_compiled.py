"""Signals of many messages at once, by the compiled pass where it can."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hil.log.signals.extract import Found, Group, Piece, pieces_of, work_out
from hil.log.signals.signal_plan import FLOAT, OTHER, MessagePlan, SignalPlan, Words

Ints = npt.NDArray[np.int64]
Parts = Sequence[tuple[MessagePlan, Group]]


def extract_all(parts: Parts, base: Words) -> list[list[Found]]:
    """Signals of each part (a message and its frames); ``base`` holds the words of groups that have a ``begin``."""
    plain: list[int] = []
    others: list[int] = []
    for number, (plan, group) in enumerate(parts):
        (plain if _is_plain(plan, group) else others).append(number)
    found: list[list[Found]] = [[] for _ in parts]
    jobs = _Jobs(parts, base)
    jobs.add_plain(plain)
    pieces: list[tuple[int, Piece]] = []
    for number in others:
        for piece in pieces_of(*parts[number]):
            if piece.plan.kind == OTHER:
                found[number].append(work_out(piece))
            else:
                pieces.append((number, piece))
                jobs.add_piece(number, piece)
    jobs.run()
    job = 0
    for number in plain:
        plan, group = parts[number]
        found[number] = _plain_found(jobs, job, plan, group)
        job += len(plan.signals)
    for (number, piece), begin, (absent, bad) in zip(pieces, jobs.outs[job:], jobs.counts[job:], strict=True):
        numbers = parts[number][0].ints[piece.place]
        values = (jobs.as_float if piece.plan.kind == FLOAT else jobs.as_int)[begin : begin + len(piece.rows)]
        one = Found(piece.place, piece.rows, values, len(piece.rows), absent, bad)
        found[number].append(_corrected(one, piece.plan, numbers, piece.words) if absent or bad else one)
    for number in others:
        found[number].sort(key=_place)
    return found


def _plain_found(jobs: "_Jobs", job: int, plan: MessagePlan, group: Group) -> list[Found]:
    """Signals of a message whose words the base holds; ``job`` is the first of them."""
    rows, n, begin, end_job = group.rows, len(group.rows), jobs.outs[job], job + len(plan.signals)
    end = begin + n * len(plan.signals)
    ints, floats = jobs.as_int[begin:end].reshape(-1, n), jobs.as_float[begin:end].reshape(-1, n)
    found = [
        Found(place, rows, (floats if signal.kind == FLOAT else ints)[place], n, absent, bad)
        for place, (signal, (absent, bad)) in enumerate(zip(plan.signals, jobs.counts[job:end_job], strict=True))
    ]
    odd = jobs.odd[job:end_job]
    if any(odd):
        for place in np.flatnonzero(odd).tolist():
            found[place] = _corrected(found[place], plan.signals[place], plan.ints[place], group.plane(0))
    return found


def _is_plain(plan: MessagePlan, group: Group) -> bool:
    """The assigned words hold all signals of all frames."""
    return plan.plain and bool(plan.signals) and group.lengths is None and group.begin is not None


def _place(found: Found) -> int:
    return found.place


def _corrected(found: Found, plan: SignalPlan, numbers: Ints, words: Words) -> Found:
    """Leave out frames whose value is not available, and do not count values out of range that have a name."""
    if found.outside:
        found = found._replace(outside=found.outside - plan.named_among(words))
    if not found.sna:
        return found
    from hil.log.signals.decode_pass import leave_out

    rows = np.empty(found.n, np.int64)
    left = leave_out(words.view(np.int64), numbers, found.values.view(np.int64), found.rows, rows)
    return found._replace(rows=rows[:left], values=found.values[:left])


class _Jobs:
    """Collects what the compiled pass is to do, and does it.

    Attributes
    ----------
    outs : where the values of each job begin in the output.
    counts : values not available and out of range, of each job.
    odd : jobs with either.
    as_int, as_float : the output.
    """

    def __init__(self, parts: Parts, base: Words) -> None:
        self._parts = parts
        self._base = base
        sizes = [len(plan.signals) for plan, _ in parts]
        self._first = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64).tolist()
        self._signals: list[int] = []
        self._begins: list[int] = []
        self._sizes: list[int] = []
        self._inside: list[bool] = []
        self._extra: list[Words] = []
        self._places: dict[int, int] = {}
        self._extra_size = 0
        self.outs: list[int] = []
        self.counts: list[list[int]] = []

    def add_plain(self, numbers: list[int]) -> None:
        """All signals of parts whose words the base holds."""
        for number in numbers:
            plan, group = self._parts[number]
            k, first = len(plan.signals), self._first[number]
            self._signals.extend(range(first, first + k))
            self._begins.extend([group.begin or 0] * k)
            self._sizes.extend([len(group.rows)] * k)
            self._inside.extend([True] * k)

    def add_piece(self, number: int, piece: Piece) -> None:
        """One signal."""
        self._signals.append(self._first[number] + piece.place)
        self._sizes.append(len(piece.rows))
        self._inside.append(piece.begin is not None)
        if piece.begin is not None:
            self._begins.append(piece.begin)
            return
        if id(piece.words) not in self._places:
            self._places[id(piece.words)] = self._extra_size
            self._extra.append(piece.words)
            self._extra_size += len(piece.words)
        self._begins.append(self._places[id(piece.words)])

    def run(self) -> None:
        """Do all jobs."""
        from hil.log.signals.decode_pass import extract

        count = len(self._signals)
        jobs = np.zeros((count, 4), np.int64)
        if count:
            jobs[:, 0], jobs[:, 1], jobs[:, 2] = self._signals, self._begins, self._sizes
            jobs[1:, 3] = np.cumsum(jobs[:-1, 2])
        self.as_int = np.empty(int(jobs[:, 2].sum()), np.int64)
        self.as_float = self.as_int.view(np.float64)
        self.outs = jobs[:, 3].tolist()
        counts = np.zeros((count, 2), np.int64)
        if count:
            ints = np.concatenate([plan.ints for plan, _ in self._parts])
            floats = np.concatenate([plan.floats for plan, _ in self._parts])
            scratch = np.zeros(1024, np.int64)
            inside = np.array(self._inside)
            for pool, chosen in ((self._base, inside), (np.concatenate([*self._extra, self._base[:0]]), ~inside)):
                some = np.flatnonzero(chosen)
                if not len(some):
                    continue
                own = np.zeros((len(some), 2), np.int64)
                words = pool.view(np.int64)
                done = extract(words, jobs[some], ints, floats, self.as_int, self.as_float, own, scratch)
                if done != len(some):
                    raise AssertionError(f"signal {done} of {len(some)} lies outside of its frames")
                counts[some] = own
        self.odd: list[bool] = (counts != 0).any(axis=1).tolist()
        self.counts = counts.tolist()

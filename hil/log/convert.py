"""Converts a log from one format to another, and reads the result back to compare."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.atomic_write import atomic_write
from hil.log.formats import writable
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts
from hil.log.read import Log, Progress, open_log
from hil.log.source import DEFAULT, ReadOptions
from hil.log.write import cannot_hold, kept, losses, write_tables

KINDS = FrameFlag.REMOTE | FrameFlag.ERROR


@dataclass(frozen=True, slots=True)
class Conversion:
    """A finished conversion: what was read, what the written file was seen to hold, and what a format cannot keep."""

    source: Path
    format: str
    account: Account
    path: Path
    frames_read: int
    frames_written: int
    notes: tuple[str, ...]


def convert(
    source: Path,
    target: Path,
    overwrite: bool = False,
    options: ReadOptions = DEFAULT,
    progress: Progress | None = None,
) -> Conversion:
    """Convert ``source`` to ``target``, whose suffix names its format; it appears only when it was read back equal.

    Memory does not grow with the log.

    Raises
    ------
    LogError
        When the source cannot be read or has no frame, the target exists or is the source, its format cannot hold the
        frames, or what was written does not read back as the same frames.
    """
    form = writable(target)
    with open_log(source, options=options) as log, atomic_write(target, overwrite, [source]) as temporary:
        facts = LogFacts.of(log.tables(_part(progress, 0)))
        account = log.account
        if not facts.frames:
            raise LogError(source, f"no frame could be read{_instead(account)}; give a CAN log")
        facts = replace(facts, start_ns=account.start_ns)
        if (problem := cannot_hold(facts, form)) is not None:
            raise LogError(target, problem)
        write_tables(log.tables(_part(progress, 1)), facts, temporary, form, options.timezone)
        with open_log(temporary, form.name, options) as back:
            frames_written, difference = _compare(log, back, facts, _part(progress, 2))
            if difference is None and not back.account.whole:
                difference = f"{back.account.rejected} of the written frames are rejected, or the file is cut off"
        if difference is not None:
            raise LogError(target, f"{difference}; nothing was kept (choose another format, and please report this)")
    return Conversion(
        log.path, log.format.name, account, target, facts.frames, frames_written, tuple(losses(facts, form))
    )


def _instead(account: Account) -> str:
    """What a log holds that has no frame."""
    found = [f"{count:,} {kind}" for kind, count in account.passed_over.most_common(3)]
    found += [f"{account.rejected:,} pieces that are none"] if account.rejected else []
    return f", but {', '.join(found)}" if found else ""


def _part(progress: Progress | None, part: int) -> Progress | None:
    return None if progress is None else lambda done: progress((part + done) / 3)


def _compare(log: Log, back: Log, facts: LogFacts, progress: Progress | None) -> tuple[int, str | None]:
    """Frames read back, and the first way in which they differ from what the format keeps; None where they do not."""
    kinds: list[int | None] = [None]
    if back.format.name == "mf4":  # one group each for data, remote and error frames: the order between is not kept
        kinds = [0, int(FrameFlag.REMOTE), int(FrameFlag.ERROR)]
    read = last = 0
    for kind in kinds:
        expected = _of_kind((kept(table, facts, back.format) for table in log.tables(progress)), kind)
        for first, wanted, got in aligned(expected, _of_kind(back.tables(), kind)):
            if len(wanted) != len(got):
                total = read + first + len(got)
                return total, f"{facts.frames} frames were written, {total} read back"
            difference = _difference(wanted, got, read + first)
            if difference is not None:
                return read + first, difference
            last = first + len(got)
        read += last
    return read, None


def _of_kind(tables: Iterable[FrameTable], kind: int | None) -> Iterator[FrameTable]:
    for table in tables:
        yield table if kind is None else table.take((table.flags & KINDS) == kind)


def aligned(one: Iterable[FrameTable], other: Iterable[FrameTable]) -> Iterator[tuple[int, FrameTable, FrameTable]]:
    """Yield (first row, table, table) of two logs cut alike; unequal only at the end, where one has more frames."""
    first = 0
    sides = [iter(one), iter(other)]
    held: list[FrameTable] = [FrameTable.empty(), FrameTable.empty()]
    while True:
        for k, side in enumerate(sides):
            while not len(held[k]):
                table = next(side, None)
                if table is None:
                    break
                held[k] = table
        n = min(len(held[0]), len(held[1]))
        if n == 0:
            yield first, held[0], held[1]
            return
        yield first, held[0].take(slice(0, n)), held[1].take(slice(0, n))
        held = [table.take(slice(n, None)) for table in held]
        first += n


def _difference(wanted: FrameTable, got: FrameTable, first: int) -> str | None:
    width = max(wanted.data.shape[1], got.data.shape[1])
    pairs: list[tuple[str, npt.NDArray[np.bool_]]] = [
        ("time", wanted.time_ns != got.time_ns),
        ("flags", wanted.flags != got.flags),
        ("channel", _channel_names(wanted) != _channel_names(got)),
        ("id", wanted.can_id != got.can_id),
        ("id width", wanted.extended != got.extended),
        ("length", wanted.length != got.length),
        ("data", (wanted.widened(width).data != got.widened(width).data).any(1)),
    ]
    for what, wrong in pairs:
        rows = np.flatnonzero(wrong)
        if len(rows):
            return f"frame {first + rows[0]} reads back with another {what}"
    return None


def _channel_names(table: FrameTable) -> npt.NDArray[np.str_]:
    return np.array(table.channels or ("",), np.str_)[table.channel]

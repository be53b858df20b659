"""Signals on one raster of time: the last value is held, as a receiver of the bus would see it."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hil.errors import BrakebenchError
from hil.log.export.blocks import Block, Field
from hil.log.signals.decoded import Rows, Values

MAX_ROWS = 200_000_000


def raster_rows(begin_ns: int, end_ns: int, step_ns: int) -> int:
    """Rows of a raster from ``begin_ns`` to ``end_ns``.

    Raises
    ------
    BrakebenchError
        When the step is not positive, or there would be more than 200 million.
    """
    if step_ns < 1:
        raise BrakebenchError("--resample takes a step above 0 s, 0.01 for 10 ms")
    rows = (end_ns - begin_ns) // step_ns + 1
    if rows > MAX_ROWS:
        raise BrakebenchError(
            f"{(end_ns - begin_ns) / 1e9:.6g} s in steps of {step_ns / 1e9:g} s are {rows:,} rows; at most "
            f"{MAX_ROWS:,} are written: choose a longer step, or a part of the log with --from and --to"
        )
    return rows


def resampled(
    blocks: Iterable[Block], fields: Sequence[Field], begin_ns: int, end_ns: int, step_ns: int
) -> Iterator[Block]:
    """Yield the signals at ``begin_ns``, ``begin_ns + step_ns``, ... up to ``end_ns``.

    A value holds from its own stamp until the next one; before its first one a signal is empty. Of frames whose stamps
    run back, what would change a row that was passed already is taken from the next row on.
    """
    rows = raster_rows(begin_ns, end_ns, step_ns)
    held: dict[str, Values] = {}  # last value of each signal
    done = 0  # rows yielded
    for block in blocks:
        if not len(block):
            continue
        reach = int(block.time_ns.max())
        until = min(rows, -((begin_ns - reach) // step_ns))  # rows before the last stamp; later frames may change it
        yield from _rows(block, fields, held, begin_ns, step_ns, done, max(done, until))
        done = max(done, until)
        _hold(block, held)
    yield from _rows(None, fields, held, begin_ns, step_ns, done, rows)


def _order(block: Block, rows: Rows) -> tuple[Rows, npt.NDArray[np.int64]]:
    times = block.time_ns[rows]
    if len(times) > 1 and (np.diff(times) < 0).any():
        order = np.argsort(times, kind="stable")
        return order, times[order]
    return np.arange(len(times)), times


def _hold(block: Block, held: dict[str, Values]) -> None:
    for name, (rows, values) in block.columns.items():
        if len(rows):
            order, _ = _order(block, rows)
            held[name] = values[order[-1:]]


def _rows(
    block: Block | None, fields: Sequence[Field], held: dict[str, Values], begin_ns: int, step_ns: int, a: int, b: int
) -> Iterator[Block]:
    size = max(1024, 1_000_000 // max(1, len(fields)))
    for begin in range(a, b, size):
        end = min(b, begin + size)
        times = begin_ns + step_ns * np.arange(begin, end, dtype=np.int64)
        yield _at(block, fields, held, times)


def _repeated(value: Values, n: int) -> Values:
    return value[np.zeros(n, np.int64)]


def _at(block: Block | None, fields: Sequence[Field], held: dict[str, Values], times: npt.NDArray[np.int64]) -> Block:
    columns: dict[str, tuple[Rows, Values]] = {}
    every = np.arange(len(times))
    for field in fields:
        before = held.get(field.name)
        found = block.columns.get(field.name) if block is not None else None
        if block is None or found is None or not len(found[0]):
            if before is not None:
                columns[field.name] = every, _repeated(before, len(times))
            continue
        order, stamps = _order(block, found[0])
        place = np.searchsorted(stamps, times, "right")
        values = found[1][order]
        if before is None:
            rows = np.flatnonzero(place > 0)
            columns[field.name] = rows, values[place[rows] - 1]
        else:
            joined: Any = np.concatenate((before.astype(values.dtype), values))
            columns[field.name] = every, joined[place]
    messages = {field.message: every for field in fields}
    return Block(times, None, (), columns, messages)

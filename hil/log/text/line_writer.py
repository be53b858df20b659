"""Writing text logs: the start time of the header, and rows written by compiled passes."""

from collections.abc import Callable, Sequence
from datetime import tzinfo
from typing import IO

import numpy as np
import numpy.typing as npt

from hil.log.frames import FrameTable, LogFacts
from hil.log.wall_clock import wall_clock_ns, wall_clock_of

ROW_BYTES = 440  # of the longest line without its channel name: 64 bytes of three letters, and the columns
BUFFER_BYTES = 4 * 1024 * 1024
_HALF_HOUR_NS = 1_800_000_000_000


def header_start_ns(facts: LogFacts, zone: tzinfo, unit_ns: int) -> int:
    """Start time for a header that holds a wall clock without a zone, ns since 1970, a multiple of ``unit_ns``.

    It is what the log states, or else its least stamp. In the hour that comes twice when clocks are put back it lies
    before that hour, so that it reads back as what it is.
    """
    start_ns = (facts.least_ns if facts.start_ns is None else facts.start_ns) // unit_ns * unit_ns
    for _ in range(48):
        if wall_clock_ns(wall_clock_of(start_ns, zone).replace(fold=0), zone) == start_ns // 1000 * 1000:
            break
        start_ns -= _HALF_HOUR_NS
    return start_ns


def channel_bytes(names: Sequence[str]) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Channel names as UTF-8, one behind the other, and where each begins (k + 1 places), for a compiled pass."""
    raw = [name.encode() for name in names]
    starts = np.concatenate(([0], np.cumsum([len(name) for name in raw], dtype=np.int64)))
    return np.frombuffer(b"".join(raw) or b"\0", np.uint8), starts


def write_rows(
    file: IO[bytes], rows: Callable[..., int], table: FrameTable, *arguments: object, name_bytes: int = 0
) -> None:
    """Write a table in pieces of bounded size.

    ``rows(out, columns, first, stop, *arguments)`` writes the lines of the rows from ``first`` to ``stop`` to the
    buffer ``out`` and returns their bytes; no line is longer than `ROW_BYTES` and ``name_bytes``, those of the longest
    channel name.
    """
    columns = (
        table.time_ns, table.channel, table.can_id, table.extended, table.length, table.data, table.flags,
    )  # fmt: skip
    columns = tuple(np.ascontiguousarray(column) for column in columns)  # type: ignore[assignment]
    row_bytes = ROW_BYTES + name_bytes
    step = max(1, BUFFER_BYTES // row_bytes)
    out = np.empty(row_bytes * min(step, max(1, len(table))), np.uint8)
    for first in range(0, len(table), step):
        n = rows(out, columns, first, min(first + step, len(table)), *arguments)
        file.write(out[:n].data)

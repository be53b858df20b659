"""Frames as a Parquet table: one row a frame, in the columns of `hil.log.frames.FrameTable.to_arrow`.

The file's metadata has ``start_ns`` where the log states a start time. It is read behind the fence, because what
Parquet's library does on a damaged file is not ours to say.
"""

import json
from collections.abc import Iterable, Iterator
from datetime import tzinfo
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from hil.log.account import FIRST_REJECTED, Account, printable
from hil.log.builder import ROWS
from hil.log.foreign.fence import fenced_bytes
from hil.log.frames import FD_CODES, MAX_EXTENDED_ID, MAX_STANDARD_ID, FrameFlag, FrameTable, LogError, LogFacts
from hil.log.source import ReadOptions, Source

START = "start_ns"
_READER = "hil.log.foreign.parquet_columns:batches"


def read_parquet(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of a Parquet table; a row that is no frame is rejected (its number stands for the offset).

    Two layouts are read: ours, and one with ``time_s`` (float64, s), flags as words and data as hex digits.

    Raises
    ------
    LogError
        When it is no such table, or its reader fails.
    """
    if source.limit_bytes is not None and source.size > source.limit_bytes:
        raise LogError(
            source.path, f"has {source.size} bytes, more than the limit; a Parquet file can only be read as a whole"
        )
    file = source.random_access()
    pieces = fenced_bytes(_READER, source.path, "Parquet reader", descriptor=file.fileno())
    import pyarrow as pa

    try:
        yield from frames_of(pieces, account)
    except pa.ArrowException as error:
        raise LogError(source.path, f"damaged Parquet file: {str(error).splitlines()[0]}") from error


def frames_of(pieces: Iterator[bytes], account: Account) -> Iterator[FrameTable]:
    """Yield the frames of what `hil.log.foreign.parquet_columns.batches` yields; a row that is none is rejected."""
    start_ns = json.loads(next(pieces))["start_ns"]
    account.start_ns = start_ns if start_ns is not None and abs(start_ns) < 2**63 else None
    channels: dict[str, int] = {}
    row = 0
    for piece in pieces:
        columns = _columns(piece)
        yield _table(columns, channels, row, account)
        row += len(columns)


def _columns(piece: bytes) -> Any:
    import pyarrow as pa

    with pa.ipc.open_stream(piece) as stream:
        batch = stream.read_next_batch()
    batch.validate(full=True)
    return batch


def _table(batch: Any, channels: dict[str, int], first: int, account: Account) -> FrameTable:
    """The frames of a batch; other rows are rejected."""
    n = len(batch)
    valid = np.ones(n, np.bool_)
    for array in batch.columns:
        if array.null_count:
            valid &= array.is_valid().to_numpy(zero_copy_only=False)
    time_ns, can_id, length, flags = (_numbers(batch, name) for name in ("time", "id", "length", "flags"))
    extended = batch.column(3).fill_null(False).to_numpy(zero_copy_only=False)
    shown, octets = _octets(batch.column(6))
    remote, error, fd = (flags & bit != 0 for bit in (FrameFlag.REMOTE, FrameFlag.ERROR, FrameFlag.FD))
    limit = np.where(extended | error, MAX_EXTENDED_ID, MAX_STANDARD_ID)
    sound = valid & (can_id >= 0) & (can_id <= limit) & (flags >= 0) & (flags < 64)
    sound &= np.where(fd, np.isin(length, FD_CODES), (length >= 0) & (length <= 8))
    sound &= shown == np.where(remote, 0, length)
    if not sound.all():
        _reject(batch, np.flatnonzero(~sound), first, account)
    width = 64 if (shown[sound] > 8).any() else 8
    data = np.zeros((int(np.count_nonzero(sound)), width), np.uint8)
    data[np.arange(width) < shown[sound, None]] = octets[np.repeat(sound, shown)]
    names = [
        channels.setdefault(printable(name or ""), len(channels)) for name in batch.column(1).dictionary.to_pylist()
    ]
    channel = np.array([*names, 0], np.int32)[batch.column(1).indices.fill_null(len(names)).to_numpy()]
    return FrameTable(
        tuple(channels),
        time_ns[sound],
        channel[sound],
        can_id[sound].astype(np.uint32),
        extended[sound] & ~error[sound],
        length[sound].astype(np.uint8),
        data,
        flags[sound].astype(np.uint8),
    )


def _numbers(batch: Any, name: str) -> npt.NDArray[np.int64]:
    column = batch.column(batch.schema.get_field_index(name))
    numbers: npt.NDArray[np.int64] = column.fill_null(0).to_numpy(zero_copy_only=False)
    return numbers


def _octets(column: Any) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8]]:
    """Bytes in each row (n,), and all of them behind each other."""
    _, offsets, values = column.fill_null(b"").buffers()
    bounds = np.frombuffer(offsets, np.int32)[: len(column) + 1].astype(np.int64)
    held = np.frombuffer(values, np.uint8) if values is not None else np.zeros(0, np.uint8)
    return np.diff(bounds), held[bounds[0] : bounds[-1]]


def _reject(batch: Any, rows: npt.NDArray[np.int64], first: int, account: Account) -> None:
    shown = max(0, FIRST_REJECTED - len(account.first_rejected))
    for row in rows[:shown].tolist():
        account.reject(first + row, str(batch.slice(row, 1).to_pylist()[0]))
    account.rejected += len(rows[shown:])


def write_parquet(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write a Parquet table in row groups of `hil.log.builder.ROWS` rows."""
    import pyarrow as pa
    import pyarrow.parquet

    schema = FrameTable.empty().to_arrow().schema
    if facts.start_ns is not None:
        schema = schema.with_metadata({START: str(facts.start_ns)})
    with pa.parquet.ParquetWriter(file, schema, compression="zstd") as writer:
        for table in tables:
            writer.write_table(table.to_arrow().cast(schema), row_group_size=ROWS)

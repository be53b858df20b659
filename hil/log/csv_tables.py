"""Raw frames as a flat table, CSV or Parquet, that needs no database.

Columns: ``time_s`` (s), ``channel`` (name), ``id`` (decimal), ``extended`` (0 or 1), ``flags`` (words of "remote error
fd brs esi", blank between them), ``length`` (data bytes; of a remote frame the requested number), ``data`` (hex).
python-can's own CSV is read too.
"""

import base64
import binascii
import csv
import re
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from hil.log.frames import FrameBuilder, FrameFlag, FrameTable, LogError, Recording

COLUMNS = ("time_s", "channel", "id", "extended", "flags", "length", "data")
PYTHON_CAN = ("timestamp", "arbitration_id", "extended", "remote", "error", "dlc", "data")
WORDS = {
    "remote": FrameFlag.REMOTE,
    "error": FrameFlag.ERROR,
    "fd": FrameFlag.FD,
    "brs": FrameFlag.BIT_RATE_SWITCH,
    "esi": FrameFlag.ERROR_STATE,
}
ROWS_PER_BATCH = 65_536
MAX_LINE = 4096
_SECONDS = re.compile(r"(\d{1,10})(?:\.(\d{1,9})\d{0,9})?")


def read_csv(path: Path) -> Recording:
    """Read frames from our CSV or python-can's; a row that is no frame is rejected.

    Raises
    ------
    LogError
        When the header is neither's.
    """
    builder = FrameBuilder()
    truncated_at: int | None = None
    with path.open("rb") as file:
        header = tuple(file.readline(MAX_LINE).decode("utf-8-sig", "replace").strip().split(","))
        if header not in (COLUMNS, PYTHON_CAN):
            raise LogError(path, f"no table of frames: expected the columns {','.join(COLUMNS)}, got {header[:8]}", 0)
        add = _add if header == COLUMNS else _add_python_can
        offset = file.tell()
        while raw := file.readline(MAX_LINE):
            begin, offset = offset, offset + len(raw)
            line = raw.decode("utf-8", "replace").strip()
            if not line:
                continue
            truncated_at = None if raw.endswith(b"\n") else begin
            cells = _cells(line)
            if len(cells) != len(header) or not _added(add, builder, dict(zip(header, cells, strict=True))):
                builder.reject(begin, line)
    return builder.recording(path, "csv", truncated_at)


def read_parquet(path: Path) -> Recording:
    """Read frames from our Parquet; a row that is no frame is rejected (its row number stands for the offset).

    Raises
    ------
    LogError
        When it is no Parquet file, or holds no such table.
    """
    builder = FrameBuilder()
    try:
        file = pa.parquet.ParquetFile(path)
        missing = [name for name in COLUMNS if name not in file.schema_arrow.names]
        if missing:
            raise LogError(path, f"no table of frames: columns {', '.join(missing)} are missing (decoded signals?)")
        row = 0
        for batch in file.iter_batches(ROWS_PER_BATCH, columns=list(COLUMNS)):
            for cells in batch.to_pylist():
                if not _added(_add, builder, cells):
                    builder.reject(row, str(cells))
                row += 1
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise LogError(path, f"damaged Parquet file: {str(error).splitlines()[0]}") from error
    return builder.recording(path, "parquet")


def _cells(line: str) -> list[str]:
    try:
        return next(csv.reader([line]), [])
    except csv.Error:  # a carriage return in the middle, say
        return []


def _added(add: Any, builder: FrameBuilder, cells: dict[str, Any]) -> bool:
    try:
        return bool(add(builder, cells))
    except (ValueError, TypeError, KeyError, OverflowError, binascii.Error):
        return False


def _ns(seconds: Any) -> int:
    if isinstance(seconds, float):  # as fine as a float64 of this size is
        return round(Decimal(seconds) * 10**6) * 1000 if seconds > 1e8 else round(seconds * 1e9)
    match = _SECONDS.fullmatch(seconds)
    if match is None:
        raise ValueError(seconds)
    return int(match[1]) * 10**9 + int((match[2] or "").ljust(9, "0"))


def _add(builder: FrameBuilder, cells: dict[str, Any]) -> bool:
    flags = FrameFlag(0)
    for word in cells["flags"].split():
        flags |= WORDS[word]
    length, data = int(cells["length"]), bytes.fromhex(cells["data"])
    if len(data) != (0 if flags & FrameFlag.REMOTE else length):
        return False
    extended = int(cells["extended"]) != 0
    return builder.add(_ns(cells["time_s"]), str(cells["channel"]), int(cells["id"]), extended, data, flags, length)


def _add_python_can(builder: FrameBuilder, cells: dict[str, str]) -> bool:
    flags = FrameFlag.REMOTE if cells["remote"] == "1" else FrameFlag(0)
    flags |= FrameFlag.ERROR if cells["error"] == "1" else FrameFlag(0)
    length, data = int(cells["dlc"]), base64.b64decode(cells["data"], validate=True)
    if len(data) != length and not flags & FrameFlag.REMOTE:
        return False
    flags |= FrameFlag.FD if length > 8 else FrameFlag(0)
    can_id = int(cells["arbitration_id"], 16)
    return builder.add(_ns(cells["timestamp"]), "can0", can_id, cells["extended"] == "1", data, flags, length)


def csv_lines(frames: FrameTable) -> Iterator[str]:
    """Yield the lines of our CSV."""
    yield ",".join(COLUMNS) + "\n"
    for row in _rows(frames):
        seconds, rest = divmod(row["time_ns"], 10**9)
        channel = row["channel"]
        if any(c in channel for c in ',"'):
            channel = '"' + channel.replace('"', '""') + '"'
        yield (
            f"{seconds}.{rest:09d},{channel},{row['id']},{row['extended']:d},{row['flags']},{row['length']},{row['data']}\n"
        )


def write_parquet(frames: FrameTable, path: Path) -> None:
    """Write our Parquet."""
    schema = pa.schema(
        [
            pa.field("time_s", pa.float64(), metadata={"unit": "s"}),
            ("channel", pa.string()),
            ("id", pa.uint32()),
            ("extended", pa.bool_()),
            ("flags", pa.string()),
            ("length", pa.uint8()),
            ("data", pa.string()),
        ]
    )
    with pa.parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for begin in range(0, len(frames), ROWS_PER_BATCH):
            part = frames.take(slice(begin, begin + ROWS_PER_BATCH))
            rows = [{"time_s": row["time_ns"] / 1e9, **row} for row in _rows(part)]
            writer.write_batch(pa.RecordBatch.from_pylist(rows, schema=schema))


def _rows(frames: FrameTable) -> Iterator[dict[str, Any]]:
    words = [" ".join(word for word, flag in WORDS.items() if flag & bits) for bits in range(32)]
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.flags, frames.length)
    payloads, width = frames.data.tobytes().hex().upper(), 2 * frames.data.shape[1]
    for row, (time_ns, channel, can_id, extended, flags, length) in enumerate(
        zip(*(c.tolist() for c in columns), strict=True)
    ):
        shown = 0 if flags & FrameFlag.REMOTE else length
        yield {
            "time_ns": time_ns,
            "channel": frames.channels[channel],
            "id": can_id,
            "extended": extended,
            "flags": words[flags & 31],
            "length": length,
            "data": payloads[row * width : row * width + 2 * shown],
        }

"""Decoded signals as tables: one wide CSV or Parquet file, or a folder of one Parquet file for each message.

Tables are written block after block, so that memory does not grow with the log.
"""

import json
import math
import os
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO, Self

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from hil.log.atomic_write import atomic_write
from hil.log.export.blocks import Block, Field, Layout, block_of, layout_of
from hil.log.frames import LogError
from hil.log.signals.decoded import Column, DecodedLog, Rows, Values

SUFFIXES = (".parquet", ".csv")
CELLS_PER_BATCH = 1_000_000  # of a CSV file
LEAST_ROWS = 1024
BYTES_PER_CELL, BYTES_PER_CHUNK = 20, 1900  # in memory: a value, and what a Parquet writer keeps of a column of a group


def export(log: DecodedLog, path: Path, overwrite: bool = False, read: Iterable[Path] = ()) -> None:
    """Write one row per frame: ``time`` (s), then a column ``MESSAGE.SIGNAL`` in the DBC's unit, empty elsewhere.

    A column ``channel`` follows ``time`` only where a message came on more than one channel. In Parquet the fields
    carry metadata: ``unit``, and ``values`` (JSON, names of raw values) where the DBC names some.

    Parameters
    ----------
    overwrite : an existing file may be replaced.
    read : files that are never replaced.

    Raises
    ------
    LogError
        For a suffix that is neither .parquet nor .csv, when the file exists, and when it cannot be written.
    """
    export_blocks([block_of(log)], layout_of(log), path, overwrite, read)


def export_blocks(
    blocks: Iterable[Block], layout: Layout, path: Path, overwrite: bool = False, read: Iterable[Path] = ()
) -> int:
    """Write blocks as one wide table and return the number of rows; parameters and errors as of `export`."""
    check_suffix(path, SUFFIXES)
    rows = 0
    with atomic_write(path, overwrite, read) as temporary, WideTable(temporary, layout) as table:
        for block in blocks:
            table.write(block)
            rows += len(block)
    return rows


def check_suffix(path: Path, suffixes: tuple[str, ...]) -> None:
    """Refuse a file whose suffix names no known kind of output."""
    if path.suffix not in suffixes:
        known = f"{', '.join(suffixes[:-1])} or {suffixes[-1]}"
        got = f"the suffix {path.suffix!r}" if path.suffix else "no suffix"
        raise LogError(path, f"signals are written as {known}, or into a FOLDER/ with a slash; got {got}")


class WideTable(AbstractContextManager["WideTable"]):
    """One CSV or Parquet file (by the suffix) with a column for every signal."""

    def __init__(self, path: Path, layout: Layout) -> None:
        self._layout = layout
        self._schema = schema_of(layout, layout.fields, "{0.name}")
        self._writer: pa.parquet.ParquetWriter | None = None
        self._opened: pa.OSFile | None = None
        self._file: IO[bytes] | None = None
        if path.suffix == ".parquet":
            self._opened = opened(path)
            self._writer = pa.parquet.ParquetWriter(self._opened, self._schema, compression="zstd")
        else:
            self._file = path.open("wb")
            self._file.write((",".join(_quoted(name) for name in self._schema.names) + "\n").encode())
        self._held: list[pa.RecordBatch] = []
        self._n_held = 0
        self._step = max(LEAST_ROWS, CELLS_PER_BATCH // max(1, len(self._schema)))
        if self._writer is not None:
            self._step = group_rows(layout.rows)
        self._options = pa.csv.WriteOptions(include_header=False, quoting_style="needed")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file."""
        self._write_held()
        if self._writer is not None:
            self._writer.close()
        if self._opened is not None:
            self._opened.close()
        if self._file is not None:
            self._file.close()

    def write(self, block: Block) -> None:
        """Write further rows, in portions of bounded memory."""
        begin = 0
        while begin < len(block):
            end = min(len(block), begin + self._step - self._n_held)
            self._held.append(batch_of(block, self._layout, self._layout.fields, self._schema, begin, end))
            self._n_held += end - begin
            if self._n_held == self._step:
                self._write_held()
            begin = end

    def _write_held(self) -> None:
        if self._held:
            table = pa.Table.from_batches(self._held)
            self._held, self._n_held = [], 0
            if self._writer is not None:
                self._writer.write_table(table)
            else:
                pa.csv.write_csv(table, self._file, self._options)


def group_rows(rows: int) -> int:
    """Rows of a group of a Parquet file of so many rows.

    A writer holds one group, and until the end some 2 kB for each column of each group written. Both together are
    least where they are equal, whatever the number of columns.
    """
    return max(LEAST_ROWS, math.isqrt(rows * BYTES_PER_CHUNK // BYTES_PER_CELL))


def opened(path: Path) -> pa.OSFile:
    """File to write; pyarrow itself refuses a path that is no UTF-8."""
    return pa.OSFile(os.fsencode(path), "wb")


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\r\n') else name


def schema_of(layout: Layout, fields: Iterable[Field], form: str) -> pa.Schema:
    """Columns of a table; ``form`` makes the name of a field."""
    columns = [pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"})]
    if layout.with_channel:
        columns.append(pa.field("channel", pa.dictionary(pa.int32(), pa.string()), nullable=False))
    for one in fields:
        metadata = {"unit": one.signal.unit}
        if one.signal.choices:
            metadata["values"] = json.dumps(one.signal.choices)
        columns.append(pa.field(form.format(one), pa.from_numpy_dtype(one.dtype), metadata=metadata))
        if layout.names and one.signal.choices:
            columns.append(pa.field(f"{form.format(one)} (name)", pa.dictionary(pa.int32(), pa.string())))
    return pa.schema(columns)


def batch_of(
    block: Block, layout: Layout, fields: Iterable[Field], schema: pa.Schema, begin: int, end: int
) -> pa.RecordBatch:
    """Rows ``begin`` to ``end`` of a block; what a row does not have is null."""
    return pa.RecordBatch.from_arrays(list(_arrays(block, layout, fields, begin, min(end, len(block)))), schema=schema)


def _arrays(block: Block, layout: Layout, fields: Iterable[Field], begin: int, end: int) -> Iterator[pa.Array]:
    n = end - begin
    yield pa.array(np.asarray(block.time_ns[begin:end] / 1e9, np.float64))
    if layout.with_channel:
        codes = np.zeros(n, np.int32) if block.channel is None else block.channel[begin:end]
        yield pa.DictionaryArray.from_arrays(codes, pa.array(list(block.channels or ("",)), pa.string()))
    for one in fields:
        rows, values = block.columns.get(one.name, _NOTHING)
        a, b = np.searchsorted(rows, (begin, end))
        named = layout.names and bool(one.signal.choices)
        if a == b:
            yield pa.nulls(n, pa.from_numpy_dtype(one.dtype))
            if named:
                yield pa.DictionaryArray.from_arrays(pa.nulls(n, pa.int32()), pa.array([], pa.string()))
            continue
        at = rows[a:b] - begin
        dense = np.zeros(n, one.dtype)
        dense[at] = values[a:b]
        empty = np.ones(n, np.bool_)
        empty[at] = False
        yield pa.array(dense, mask=empty)
        if named:
            place = np.zeros(n, np.int64)
            place[at] = np.arange(b - a)
            texts = Column(one.signal, rows[a:b], values[a:b]).to_arrow_names()
            yield texts.take(pa.array(place, mask=empty))


_NOTHING: tuple[Rows, Values] = (np.zeros(0, np.int64), np.zeros(0))

"""Decoded signals as one wide table: Parquet or CSV."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from hil.log.atomic_write import atomic_write
from hil.log.decode import DecodedLog
from hil.log.frames import LogError

SUFFIXES = (".parquet", ".csv")
CELLS_PER_BATCH = 4_000_000


def export(log: DecodedLog, path: Path, overwrite: bool = True) -> None:
    """Write one row per frame: ``time`` (s), then a column ``MESSAGE.SIGNAL`` in the DBC's unit, empty elsewhere.

    A column ``channel`` follows ``time`` only where a message came on more than one channel. In Parquet the fields
    carry metadata: ``unit``, and ``values`` (JSON, names of raw values) where the DBC names some.

    Raises
    ------
    LogError
        For a suffix that is neither .parquet nor .csv, and when the file cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise LogError(path, f"signals are written as {' or '.join(SUFFIXES)}, got {path.suffix or 'no suffix'!r}")
    schema = _schema(log)
    with atomic_write(path, overwrite) as temporary:
        if path.suffix == ".parquet":
            with pa.parquet.ParquetWriter(temporary, schema, compression="zstd") as writer:
                for batch in _batches(log, schema):
                    writer.write_batch(batch)
            return
        with temporary.open("wb") as file:
            file.write((",".join(_quoted(name) for name in schema.names) + "\n").encode())
            options = pa.csv.WriteOptions(include_header=False, quoting_style="needed")
            for batch in _batches(log, schema):
                pa.csv.write_csv(batch, file, options)


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\r\n') else name


def _schema(log: DecodedLog) -> pa.Schema:
    fields = [pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"})]
    if log.several_channels:
        fields.append(pa.field("channel", pa.dictionary(pa.int32(), pa.string()), nullable=False))
    for name, column in log.columns.items():
        metadata = {"unit": column.signal.unit}
        if column.signal.choices:
            metadata["values"] = json.dumps(column.signal.choices)
        fields.append(pa.field(name, pa.from_numpy_dtype(column.values.dtype), metadata=metadata))
    return pa.schema(fields)


def _batches(log: DecodedLog, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    """Rows in portions of bounded memory; sparse columns become nulls."""
    n = len(log.time_s)
    step = max(1024, CELLS_PER_BATCH // max(1, len(schema)))
    for begin in range(0, n, step):
        end = min(n, begin + step)
        arrays: list[pa.Array] = [pa.array(log.time_s[begin:end])]
        if log.several_channels:
            codes = log.recording.frames.channel[begin:end]
            arrays.append(pa.DictionaryArray.from_arrays(codes, list(log.recording.frames.channels)))
        for column in log.columns.values():
            a, b = np.searchsorted(column.rows, (begin, end))
            if a == b:
                arrays.append(pa.nulls(end - begin, pa.from_numpy_dtype(column.values.dtype)))
                continue
            at = column.rows[a:b] - begin
            values = np.zeros(end - begin, column.values.dtype)
            values[at] = column.values[a:b]
            empty = np.ones(end - begin, np.bool_)
            empty[at] = False
            arrays.append(pa.array(values, mask=empty))
        yield pa.RecordBatch.from_arrays(arrays, schema=schema)

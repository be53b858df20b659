"""The columns of a Parquet file of frames, brought to one form; runs behind the fence (`hil.log.foreign.fenced`).

First comes a JSON object with ``start_ns`` (or null), then one Arrow stream a batch with the columns of `SCHEMA`; what
cannot be brought to that form is null.
"""

import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet

from hil.errors import BrakebenchError
from hil.log.builder import ROWS

COLUMNS = ("time", "channel", "id", "extended", "length", "flags", "data")
OLD_COLUMNS = ("time_s", "channel", "id", "extended", "length", "flags", "data")
"""Columns of the other layout: seconds as float64, flags as words, data as hex digits."""
START = b"start_ns"
SCHEMA = pa.schema(
    [
        ("time", pa.int64()),
        ("channel", pa.dictionary(pa.int32(), pa.string())),
        ("id", pa.int64()),
        ("extended", pa.bool_()),
        ("length", pa.int64()),
        ("flags", pa.int64()),
        ("data", pa.binary()),
    ]
)
WORDS = ("remote", "error", "fd", "brs", "esi", "tx")  # of the flags, in the order of their bits
FREE_ROWS, ROWS_PER_BYTE = 4_000_000, 4
"""A file may have so many rows, and so many more for each of its bytes: repeated rows take next to no bytes, but time
and memory when they are read."""
_MAX_NAME = 1024
_MAX_DATA = 64
_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_NIBBLE = np.full(256, 16, np.uint8)
for _value, _letter in enumerate(b"0123456789ABCDEF"):
    _NIBBLE[[_letter, ord(chr(_letter).lower())]] = _value


def warm() -> None:
    """Load what reading needs, with one thread, before memory is limited."""
    pa.set_cpu_count(1)
    pa.set_io_thread_count(1)
    file = io.BytesIO()
    for compression in ("zstd", "snappy", "gzip", "brotli", "lz4"):
        file = io.BytesIO()
        pa.parquet.write_table(pa.table({"a": ["x"]}), file, compression=compression)
        next(pa.parquet.ParquetFile(file).iter_batches())


def batches(path: Path) -> Iterator[bytes]:
    """Yield the start time, then the frames of a Parquet file.

    Raises
    ------
    BrakebenchError
        When it holds no table of frames.
    """
    with pa.parquet.ParquetFile(str(path), pre_buffer=False) as file:
        names = file.schema_arrow.names
        columns = OLD_COLUMNS if "time_s" in names else COLUMNS
        missing = [name for name in columns if name not in names]
        if missing:
            raise BrakebenchError(f"no table of frames: columns {', '.join(missing)} are missing (decoded signals?)")
        start = (file.schema_arrow.metadata or {}).get(START, b"")
        yield json.dumps({"start_ns": int(start) if start.lstrip(b"-").isdigit() else None}).encode()
        size, rows = path.stat().st_size, 0
        for batch in file.iter_batches(ROWS, columns=list(columns), use_threads=False):
            rows += len(batch)
            if rows > FREE_ROWS + ROWS_PER_BYTE * size:
                raise BrakebenchError(f"more than {FREE_ROWS + ROWS_PER_BYTE * size} rows in {size} bytes: no log")
            arrays = [
                _TO_COLUMN[name](_flat(batch.column(batch.schema.get_field_index(name)), name), name)
                for name in columns
            ]
            out = io.BytesIO()
            with pa.ipc.new_stream(out, SCHEMA) as stream:
                stream.write_batch(pa.RecordBatch.from_arrays(arrays, schema=SCHEMA))
            yield out.getvalue()


def _flat(array: Any, name: str) -> Any:
    """Values of a column without its dictionary; texts that are too long become null first."""
    if not pa.types.is_dictionary(array.type):
        return array
    values = array.dictionary
    if pa.types.is_string(values.type) or pa.types.is_binary(values.type) or pa.types.is_large_string(values.type):
        values = pc.if_else(pc.less_equal(pc.binary_length(values), _MAX_NAME), values, None)
    return values.take(array.indices)


def _wrong(array: Any, name: str, expected: str) -> BrakebenchError:
    return BrakebenchError(f"no table of frames: column {name} is {array.type}, expected {expected}")


def _int64(values: npt.NDArray[Any], valid: npt.NDArray[np.bool_]) -> Any:
    return pa.array(values.astype(np.int64), pa.int64(), mask=~valid)


def _time(array: Any, name: str) -> Any:
    if pa.types.is_timestamp(array.type):
        unit = _UNITS[array.type.unit]
        array = array.cast(pa.int64())
    elif pa.types.is_int64(array.type):
        unit = 1
    else:
        raise _wrong(array, name, "timestamp[ns]")
    values = pc.fill_null(array, 0).to_numpy(zero_copy_only=False)
    inside = np.abs(values // 2) < 2**62 // unit if unit > 1 else np.ones(len(values), np.bool_)
    return _int64(np.where(inside, values, 0) * unit, inside & _valid(array))


def _seconds(array: Any, name: str) -> Any:
    if not pa.types.is_floating(array.type):
        raise _wrong(array, name, "double")
    values = pc.fill_null(array, 0).to_numpy(zero_copy_only=False).astype(np.float64)
    inside = np.abs(values) <= 9e9
    values = np.where(inside, values, 0.0)
    whole = np.floor(values)
    rest = values - whole
    fine = np.abs(values) < 1e8  # a float64 of a time since 1970 is good for a microsecond only
    below = np.where(fine, np.rint(rest * 1e9), np.rint(rest * 1e6) * 1000)
    return _int64(whole.astype(np.int64) * 1_000_000_000 + below.astype(np.int64), inside & _valid(array))


def _valid(array: Any) -> npt.NDArray[np.bool_]:
    valid: npt.NDArray[np.bool_] = array.is_valid().to_numpy(zero_copy_only=False)
    return valid


def _channel(array: Any, name: str) -> Any:
    if not (pa.types.is_string(array.type) or pa.types.is_large_string(array.type)):
        raise _wrong(array, name, "string")
    array = pc.if_else(pc.less_equal(pc.binary_length(array), _MAX_NAME), array, None)
    return _coded(array, lambda name: name.decode("utf-8", "backslashreplace"), pa.string())


def _coded(array: Any, meaning: Callable[[bytes], Any], kind: Any) -> Any:
    """Texts as a dictionary of what they mean; they need not be sound UTF-8."""
    coded = array.cast(pa.large_binary() if pa.types.is_large_string(array.type) else pa.binary()).dictionary_encode()
    values = [meaning(text) for text in coded.dictionary.to_pylist()]
    return pa.DictionaryArray.from_arrays(coded.indices, pa.array(values, kind))


def _integer(array: Any, name: str) -> Any:
    if not pa.types.is_integer(array.type):
        raise _wrong(array, name, "an integer")
    return array.cast(pa.int64(), safe=False)


def _truth(array: Any, name: str) -> Any:
    if pa.types.is_boolean(array.type):
        return array
    return pc.not_equal(_integer(array, name), 0)


def _flags(array: Any, name: str) -> Any:
    if not pa.types.is_string(array.type):
        return _integer(array, name)
    coded = _coded(array, _bits, pa.int64())
    return coded.dictionary.take(coded.indices)


def _bits(text: bytes) -> int | None:
    words = set(text.decode("ascii", "replace").split())
    return sum(1 << WORDS.index(word) for word in words) if words <= set(WORDS) else None


def _data(array: Any, name: str) -> Any:
    if pa.types.is_string(array.type):
        return _from_hex(array)
    if not (pa.types.is_binary(array.type) or pa.types.is_large_binary(array.type)):
        if not pa.types.is_fixed_size_binary(array.type):
            raise _wrong(array, name, "binary")
        array = array.cast(pa.binary())
    return pc.if_else(pc.less_equal(pc.binary_length(array), _MAX_DATA), array, None).cast(pa.binary())


def _from_hex(array: Any) -> Any:
    lengths = pc.fill_null(pc.binary_length(array), 1).to_numpy(zero_copy_only=False).astype(np.int64)
    good = (lengths % 2 == 0) & (lengths <= 2 * _MAX_DATA)
    digits = _NIBBLE[_octets(array, good)]
    rows = np.repeat(np.flatnonzero(good), lengths[good])
    good[rows[digits > 15]] = False
    pairs = digits[good[rows]].reshape(-1, 2)
    sizes = np.where(good, lengths // 2, 0)
    octets = (pairs[:, 0] << 4 | pairs[:, 1]).astype(np.uint8)
    offsets = np.concatenate(([0], np.cumsum(sizes))).astype(np.int32)
    binary = pa.Array.from_buffers(
        pa.binary(), len(array), [None, pa.py_buffer(offsets), pa.py_buffer(np.ascontiguousarray(octets))]
    )
    return pc.if_else(pa.array(good), binary, None)


def _octets(array: Any, good: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """Letters of the good rows, one row behind the other."""
    chosen = array.filter(pa.array(good))
    _, offsets, letters = chosen.buffers()
    bounds = np.frombuffer(offsets, np.int32)[chosen.offset : chosen.offset + len(chosen) + 1]
    held = np.frombuffer(letters, np.uint8) if letters is not None else np.zeros(0, np.uint8)
    return held[bounds[0] : bounds[-1]]


_TO_COLUMN: dict[str, Callable[[Any, str], Any]] = {
    "time": _time,
    "time_s": _seconds,
    "channel": _channel,
    "id": _integer,
    "extended": _truth,
    "length": _integer,
    "flags": _flags,
    "data": _data,
}

"""What the tests of decoding share."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from dbc.database import parse_database
from hil.log.frames import FrameTable, Recording


def as_j1939(database):
    """The database with every 29-bit message standing for its parameter group."""
    messages = {
        key: replace(message, pgn_match=True) if message.extended else message
        for key, message in database.messages.items()
    }
    return replace(database, messages=messages)


def database_of(*lines, source="database"):
    return parse_database('VERSION ""\nBU_: A\n' + "\n".join(lines), source)


def table_of(frames, channels=("can0",), width=None, step_ns=10_000_000):
    """frames: (can_id, data) or (can_id, data, flags, channel, time_ns); more than 11 bits are an extended id."""
    width = width or (64 if any(len(f[1]) > 8 for f in frames) else 8)
    table = FrameTable.empty(len(frames), width, channels)
    for row, (can_id, data, *rest) in enumerate(frames):
        table.time_ns[row] = rest[2] if len(rest) > 2 else row * step_ns
        table.can_id[row] = can_id & 0x1FFFFFFF
        table.extended[row] = can_id > 0x7FF
        table.length[row] = len(data)
        table.data[row, : len(data)] = list(data)
        table.flags[row] = rest[0] if rest else 0
        table.channel[row] = rest[1] if len(rest) > 1 else 0
    return table


def recording(frames, channels=("can0",)):
    return Recording(Path("memory"), "candump", table_of(frames, channels))


def assert_same(a, b):
    """Two results agree bit by bit."""
    assert_same_counts(a, b)
    assert list(a.columns) == list(b.columns)
    for name in a.columns:
        one, other = a.columns[name], b.columns[name]
        assert one.values.dtype == other.values.dtype, name
        np.testing.assert_array_equal(one.rows, other.rows, name)
        np.testing.assert_array_equal(one.values.view(np.uint64), other.values.view(np.uint64), name)
        assert one.source == other.source
    assert list(a.rows) == list(b.rows)
    for name in a.rows:
        np.testing.assert_array_equal(a.rows[name], b.rows[name], name)


def assert_same_counts(a, b):
    for name in ("frames", "decoded", "unknown", "rejected", "reasons", "unknown_ids", "messages", "signals"):
        assert getattr(a, name) == getattr(b, name), name
    assert a.transport == b.transport
    assert a.several_channels == b.several_channels
    assert sorted(a.notes) == sorted(b.notes)


def joined_columns(logs):
    """Columns of tables that follow one another, as (rows, values) of the whole."""
    columns, before = {}, 0
    for log in logs:
        for name, column in log.columns.items():
            rows, values = columns.setdefault(name, ([], []))
            rows.append(column.rows + before)
            values.append(column.values)
        before += len(log.time_s)
    return {name: (np.concatenate(rows), np.concatenate(values)) for name, (rows, values) in columns.items()}

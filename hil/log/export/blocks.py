"""Decoded rows on their way to a file, whatever its format."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.log.frames import FrameTable
from hil.log.signals.decode import Decoder
from hil.log.signals.decoded import DecodedLog, Rows, Values


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A column of the output: ``MESSAGE.SIGNAL``."""

    message: str
    signal: Signal
    dtype: np.dtype[Any]

    @property
    def name(self) -> str:
        """``MESSAGE.SIGNAL``."""
        return f"{self.message}.{self.signal.name}"


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Rows to be written.

    Attributes
    ----------
    time_ns : int64 (n,).
    channel : index into ``channels`` of each row; None where rows belong to none (a raster).
    columns : by ``MESSAGE.SIGNAL``: rows (ascending) and values.
    rows : rows of each message.
    """

    time_ns: npt.NDArray[np.int64]
    channel: npt.NDArray[np.int32] | None
    channels: tuple[str, ...]
    columns: Mapping[str, tuple[Rows, Values]]
    rows: Mapping[str, Rows]

    def __len__(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """What is written.

    Attributes
    ----------
    fields : the columns, in their order.
    with_channel : a column ``channel`` follows ``time``.
    names : beside each signal with named values, a column ``MESSAGE.SIGNAL (name)`` has the names.
    start_ns : start time of the log, for formats that have one.
    channel_of : channel of each message.
    rows : how many there will be, about.
    """

    fields: tuple[Field, ...]
    with_channel: bool = False
    names: bool = False
    start_ns: int = 0
    channel_of: Mapping[str, str] = field(default_factory=dict)
    rows: int = 0


def block_of(log: DecodedLog) -> Block:
    """Return decoded frames as rows to be written, one row per frame."""
    frames = log.recording.frames
    columns = {name: (column.rows, column.values) for name, column in log.columns.items()}
    return Block(frames.time_ns, frames.channel, frames.channels, columns, log.rows)


def layout_of(log: DecodedLog) -> Layout:
    """Return what is written of decoded frames: all columns that they have."""
    fields = tuple(
        Field(name.rpartition(".")[0], column.signal, column.values.dtype) for name, column in log.columns.items()
    )
    return Layout(fields, log.several_channels, rows=len(log.recording.frames))


def blocks_of(tables: Iterable[FrameTable], decoder: Decoder) -> Iterator[Block]:
    """Yield the signals of tables as rows to be written, one row per frame."""
    for table in tables:
        yield block_of(decoder.add(table))


def grouped(layout: Layout) -> dict[str, list[Field]]:
    """Columns by message."""
    groups: dict[str, list[Field]] = {}
    for one in layout.fields:
        groups.setdefault(one.message, []).append(one)
    return groups


def of_message(block: Block, message: str, fields: list[Field]) -> Block | None:
    """Rows of one message as a block of their own; None where it has none."""
    rows = block.rows.get(message)
    if rows is None or not len(rows):
        return None
    columns = {}
    for one in fields:
        if one.name in block.columns:
            at, values = block.columns[one.name]
            columns[one.name] = np.searchsorted(rows, at), values
    channel = None if block.channel is None else block.channel[rows]
    n = np.arange(len(rows))
    return Block(block.time_ns[rows], channel, block.channels, columns, {message: n})

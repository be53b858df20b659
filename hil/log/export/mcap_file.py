"""Decoded signals as an MCAP file (https://mcap.dev/spec), read by Foxglove, PlotJuggler and Rerun.

One topic for each message of each channel, ``/CHANNEL/MESSAGE``; a message in it is one frame: every signal a double
in the database's unit, NaN where the frame does not have it, and the name of a named value as a text beside it.
Protocol Buffers, the only encoding of numbers that all three read (Rerun takes JSON for bytes without meaning).
"""

import json
import re
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hil.extras import missing
from hil.log.atomic_write import atomic_write
from hil.log.export.blocks import Block, Field, Layout, grouped, of_message
from hil.log.export.protobuf import DOUBLE, STRING, description, number_of, rows_of, text
from hil.log.frames import LogError
from hil.log.signals.decoded import Column

PACKAGE = "can"
"""Protocol Buffers package of all messages."""
CHUNK_BYTES = 1_000_000  # of a chunk before it is compressed; what a writer holds
MOST_TOPICS = 65_535  # their numbers have 16 bits


def check_extra(path: Path) -> None:
    """Refuse to write without the library.

    Raises
    ------
    LogError
        It says how to get it.
    """
    if lacks := missing("mcap"):
        raise LogError(path, f"writing MCAP {lacks}")


def write_mcap(
    blocks: Iterable[Block], layout: Layout, path: Path, overwrite: bool = False, read: Iterable[Path] = ()
) -> int:
    """Write blocks as messages of an MCAP file and return how many, by its own summary.

    Parameters and errors as of `hil.log.export.tables.export_blocks`.
    """
    with atomic_write(path, overwrite, read) as temporary:
        with McapMessages(temporary, layout) as messages:
            for block in blocks:
                messages.write(block)
        counted = sum(messages_in(temporary).values())
        if counted != messages.written:
            raise LogError(path, f"{messages.written} messages were written, its summary has {counted}")
    return counted


class McapMessages(AbstractContextManager["McapMessages"]):
    """Writes blocks as messages of an MCAP file, in the order of the log.

    Attributes
    ----------
    written : messages so far.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        check_extra(path)
        from mcap.writer import CompressionType, Writer

        self._path = path
        self._layout = layout
        taken: dict[str, None] = {}
        self._groups = {
            message: _Topic(identifier(message, taken), fields) for message, fields in grouped(layout).items()
        }
        self._topics: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._file = path.open("wb")
        self._writer: Writer = Writer(self._file, CHUNK_BYTES, CompressionType.ZSTD)
        self._writer.start("", "brakebench")
        self.written = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        try:
            if kind is None:
                self._writer.finish()  # type: ignore[no-untyped-call]  # mcap states no type here
        finally:
            self._file.close()

    def write(self, block: Block) -> None:
        """Write further rows.

        Raises
        ------
        LogError
            For stamps before 1970, which MCAP cannot hold.
        """
        if len(block) and int(block.time_ns.min()) < 0:
            raise LogError(self._path, "MCAP cannot hold stamps before 1970; write the signals as Parquet or MF4")
        found: list[tuple[int, int, int, bytes]] = []
        for message, topic in self._groups.items():
            own = of_message(block, message, topic.fields)
            if own is None:
                continue
            ids = self._ids(message, own)
            found += zip(block.rows[message].tolist(), ids, own.time_ns.tolist(), topic.encoded(own), strict=True)
        found.sort(key=lambda one: one[0])
        for _, topic_id, time_ns, data in found:
            self._writer.add_message(topic_id, time_ns, data, time_ns)
        self.written += len(found)

    def _ids(self, message: str, own: Block) -> list[int]:
        """Topic of each row of a message."""
        if own.channel is None or not own.channels:
            return [self._id(message, self._layout.channel_of.get(message, ""))] * len(own)
        held = {place: self._id(message, own.channels[place]) for place in np.unique(own.channel).tolist()}
        return [held[place] for place in own.channel.tolist()]

    def _id(self, message: str, channel: str) -> int:
        key = message, channel
        if key not in self._topics:
            if len(self._topics) == MOST_TOPICS:
                raise LogError(self._path, f"MCAP holds {MOST_TOPICS} topics; choose with --messages or --channel")
            topic = self._groups[message]
            if message not in self._schemas:
                self._schemas[message] = self._writer.register_schema(
                    f"{PACKAGE}.{topic.name}", "protobuf", description(PACKAGE, topic.name, topic.types())
                )
            self._topics[key] = self._writer.register_channel(
                f"/{channel}/{message}" if channel else f"/{message}", "protobuf", self._schemas[message], topic.about()
            )
        return self._topics[key]


class _Topic:
    """How the frames of one message are encoded."""

    def __init__(self, name: str, fields: list[Field]) -> None:
        self.name = name
        self.fields = fields
        taken: dict[str, None] = {}
        self._numbers = [identifier(one.signal.name, taken) for one in fields]
        self._named = [one for one in fields if one.signal.choices]
        self._texts = [identifier(f"{one.signal.name}_name", taken) for one in self._named]

    def types(self) -> list[tuple[str, int]]:
        """Name and type of every field."""
        return [*((name, DOUBLE) for name in self._numbers), *((name, STRING) for name in self._texts)]

    def about(self) -> dict[str, str]:
        """Metadata of a topic: units, and the names of values."""
        units = {f"unit.{n}": one.signal.unit for n, one in zip(self._numbers, self.fields, strict=True)}
        names = {
            f"values.{name}": json.dumps(one.signal.choices)
            for name, one in zip(self._numbers, self.fields, strict=True)
            if one.signal.choices
        }
        return {key: value for key, value in (units | names).items() if value}

    def encoded(self, own: Block) -> Iterable[bytes]:
        """Each row of a block of this message."""
        n = len(own)
        rows = rows_of([_dense(one, own) for one in self.fields], n)
        width = rows.shape[1]
        whole = rows.tobytes()
        fixed = [whole[i * width : (i + 1) * width] for i in range(n)]
        if not self._named:
            return fixed
        texts = [_names(one, own, number_of(len(self.fields) + k)) for k, one in enumerate(self._named)]
        return [b"".join(parts) for parts in zip(fixed, *texts, strict=True)]


def _dense(one: Field, own: Block) -> npt.NDArray[np.float64]:
    dense = np.full(len(own), np.nan)
    if one.name in own.columns:
        at, values = own.columns[one.name]
        dense[at] = values
    return dense


def _names(one: Field, own: Block, number: int) -> list[bytes]:
    """The name of a value as a field; nothing where it has none."""
    out = [b""] * len(own)
    if one.name in own.columns:
        at, values = own.columns[one.name]
        known: dict[object, bytes] = {None: b""}
        for row, name in zip(at.tolist(), Column(one.signal, at, values).names().tolist(), strict=True):
            if name not in known:
                known[name] = text(number, name)
            out[row] = known[name]
    return out


def identifier(name: str, taken: dict[str, None]) -> str:
    """A name as Protocol Buffers take it: letters, digits and underscores; each one once."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    plain = plain if plain and not plain[0].isdigit() else f"_{plain}"
    held, number = plain, 2
    while held in taken:
        held, number = f"{plain}_{number}", number + 1
    taken[held] = None
    return held


def messages_in(path: Path) -> Mapping[str, int]:
    """Messages of each topic of a finished MCAP file, by its own summary."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise LogError(path, "has no summary: it was not finished")
    counts = summary.statistics.channel_message_counts
    return {one.topic: counts.get(number, 0) for number, one in summary.channels.items()}

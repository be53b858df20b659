"""Writes blocks of an ASAM MDF 4.11 file: groups of records with their channels, and packed blocks of data.

Descriptions stand before the data they describe, and a list of data blocks before most of what it lists: a file that is
cut off later can be read up to there.
"""

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import IO
from xml.sax.saxutils import escape

import numpy as np

VERSION = 411
LEVEL = 1  # of deflate: higher ones take several times as long for a few per cent
BUS_EVENT = 0x400
INVALID_BIT = 0x2
UNSIGNED, SIGNED, FLOAT, BYTES = 0, 2, 4, 10
LIST_SIZES = (16, 64, 256, 1024)  # data blocks of the first, second, ... list; the last one for all others

_deflate: Callable[[bytes, int], bytes] = zlib.compress
try:
    from isal import isal_zlib as _isal  # several times as fast

    _deflate = _isal.compress
except ImportError:
    pass


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a group.

    Attributes
    ----------
    data_type, byte, bits : as it stands in the record.
    kind, sync : 0, 0 for a plain channel; 2, 1 for the time.
    linear : offset and factor.
    texts : text by value.
    members : of a structure.
    invalid_bit : number of its bit in the invalidation bytes; None where all samples are valid.
    """

    name: str
    data_type: int
    byte: int
    bits: int
    kind: int = 0
    sync: int = 0
    flags: int = 0
    unit: str = ""
    comment: str = ""
    linear: tuple[float, float] | None = None
    texts: Mapping[float, str] = field(default_factory=dict)
    members: Sequence["Channel"] = ()
    invalid_bit: int | None = None


TIME = Channel("Timestamp", SIGNED, 0, 64, kind=2, sync=1, unit="s", linear=(0.0, 1e-9))
"""Time as int64 nanoseconds since the start."""


class MdfWriter:
    """Blocks, one behind the other.

    Parameters
    ----------
    file : open for reading and writing, empty.
    start_ns : start time, ns since 1970, not negative.
    comment : what the file holds.
    """

    def __init__(self, file: IO[bytes], start_ns: int, comment: str) -> None:
        self.file = file
        self.end = 0
        self._texts: dict[tuple[bytes, str], int] = {}
        self._last_group = 64 + 24  # where the link to the next data group stands
        self._append(struct.pack("<8s8s8s4xH30xHH", b"MDF     ", b"4.11    ", b"brakebnc", VERSION, 0, 0))
        header = self.add(b"HD", [0] * 6, struct.pack("<QhhBBBxdd", start_ns, 0, 0, 2, 0, 0, 0.0, 0.0))
        assert header == 64
        history = f"<FHcomment><TX>{escape(comment)}</TX><tool_id>brakebench</tool_id>"
        history += "<tool_vendor>brakebench</tool_vendor><tool_version>1</tool_version></FHcomment>"
        made = self.add(b"FH", [0, self.text(history, b"MD")], struct.pack("<QhhB3x", start_ns, 0, 0, 2))
        self.patch(64 + 24 + 8, "<Q", made)

    def add(self, ident: bytes, links: Sequence[int], data: bytes) -> int:
        """Append a block; returns its address."""
        length = 24 + 8 * len(links) + len(data)
        head = struct.pack(f"<4s4xQQ{len(links)}Q", b"##" + ident, length, len(links), *links)
        return self._append(head + data)

    def _append(self, content: bytes) -> int:
        address = self.end
        self.file.seek(address)
        self.file.write(content)
        self.end = address + len(content)
        if self.end % 8:
            self.file.write(bytes(-self.end % 8))
            self.end += -self.end % 8
        return address

    def reserve(self, n: int) -> int:
        """Append ``n`` bytes to be written later; returns where they stand."""
        return self._append(bytes(n))

    def patch(self, at: int, form: str, *values: int) -> None:
        """Write over what stands at an offset."""
        self.file.seek(at)
        self.file.write(struct.pack(form, *values))

    def text(self, text: str, ident: bytes = b"TX") -> int:
        """Address of a text block; 0 for no text."""
        if not text:
            return 0
        found = self._texts.get((ident, text))
        if found is None:
            raw = text.encode("utf-8", "replace").replace(b"\0", b"?") + b"\0"
            found = self.add(ident, [], raw + bytes(-len(raw) % 8))
            if len(self._texts) < 10_000:
                self._texts[ident, text] = found
        return found

    def source(self, name: str, path: str = "") -> int:
        """Source of a group: a CAN bus."""
        return self.add(b"SI", [self.text(name), self.text(path), 0], struct.pack("<BBB5x", 2, 2, 0))

    def group(
        self,
        name: str,
        source: int,
        channels: Sequence[Channel],
        data_bytes: int,
        inval_bytes: int = 0,
        flags: int = 0,
        comment: str = "",
    ) -> "GroupWriter":
        """Append a data group of one channel group; `TIME` is its first channel."""
        first = self._channels((TIME, *channels))
        facts = struct.pack("<QQHH4xII", 0, 0, flags, ord(".") if flags else 0, data_bytes, inval_bytes)
        links = [0, first, self.text(name), source, 0, self.text(comment)]
        group = self.add(b"CG", links, facts)
        data = self.add(b"DG", [0, group, 0, 0], bytes(8))
        self.patch(self._last_group, "<Q", data)
        self._last_group = data + 24
        return GroupWriter(self, data + 24 + 16, group + 24 + 48 + 8, data_bytes + inval_bytes)

    def _channels(self, channels: Sequence[Channel]) -> int:
        following = 0
        for channel in reversed(channels):
            flags = channel.flags
            members = self._channels(channel.members) if channel.members else 0
            conversion = self._conversion(channel)
            if channel.invalid_bit is not None:
                flags |= INVALID_BIT
            facts = struct.pack(
                "<4B4IBxH6d",
                channel.kind, channel.sync, channel.data_type, 0, channel.byte, channel.bits, flags,
                channel.invalid_bit or 0, 0, 0, *[0.0] * 6,
            )  # fmt: skip
            texts = [self.text(channel.unit), self.text(channel.comment)]
            links = [following, members, self.text(channel.name), 0, conversion, 0, *texts]
            following = self.add(b"CN", links, facts)
        return following

    def _conversion(self, channel: Channel) -> int:
        if channel.linear is not None:
            return self.add(b"CC", [0] * 4, struct.pack("<BBHHH4d", 1, 0, 0, 0, 2, 0.0, 0.0, *channel.linear))
        if channel.texts:
            values = list(channel.texts)
            # no default: beside a conversion of numbers as default, asammdf 8.8 makes NaN of the named values
            refs = [*(self.text(text) for text in channel.texts.values()), 0]
            facts = struct.pack("<BBHHH2d", 7, 0, 0, len(refs), len(values), 0.0, 0.0)
            return self.add(b"CC", [0, 0, 0, 0, *refs], facts + struct.pack(f"<{len(values)}d", *values))
        return 0


class GroupWriter:
    """Data of one group, block by block.

    Parameters
    ----------
    link_at : where the link to the data stands.
    cycles_at : where the number of records stands.
    stride : bytes of a record.
    """

    def __init__(self, writer: MdfWriter, link_at: int, cycles_at: int, stride: int) -> None:
        self.writer = writer
        self.link_at = link_at
        self.cycles_at = cycles_at
        self.stride = stride
        self.cycles = 0
        self._first: int | None = None
        self._offset = 0  # of the next block in the data
        self._lists = 0
        self._list_at = 0
        self._next_at = 0  # where the link to this list stands
        self._links: list[int] = []
        self._offsets: list[int] = []

    def write(self, records: bytes) -> None:
        """Append whole records as one block, transposed and packed where that is smaller."""
        address = self._block(records)
        begin, self._offset = self._offset, self._offset + len(records)
        self.cycles += len(records) // self.stride
        if self._first is None:
            self._first = address
            self.writer.patch(self.link_at, "<Q", address)
            return
        if not self._lists:
            head = self.writer.add(b"HL", [0], struct.pack("<HB5x", 0, 1))
            self.writer.patch(self.link_at, "<Q", head)
            self._next_at = head + 24
            self._open_list()
            self._links, self._offsets = [self._first], [0]
        elif len(self._links) == self._size:
            self._close_list()
            self._next_at = self._list_at + 24
            self._open_list()
        self._links.append(address)
        self._offsets.append(begin)

    def _block(self, records: bytes) -> int:
        lines = np.frombuffer(records, np.uint8).reshape(-1, self.stride)
        packed = _deflate(np.ascontiguousarray(lines.T).data, LEVEL)  # type: ignore[arg-type]  # any buffer
        if len(packed) + 24 >= len(records):
            return self.writer.add(b"DT", [], records)
        facts = struct.pack("<2sBxIQQ", b"DT", 1, self.stride, len(records), len(packed))
        return self.writer.add(b"DZ", [], facts + packed)

    @property
    def _size(self) -> int:
        return LIST_SIZES[min(self._lists, len(LIST_SIZES)) - 1]

    def _open_list(self) -> None:
        self._lists += 1
        self._list_at = self.writer.reserve(24 + 8 + 8 + 16 * self._size)
        self.writer.patch(self._next_at, "<Q", self._list_at)
        self._links, self._offsets = [], []

    def _close_list(self) -> None:
        n = len(self._links)
        content = struct.pack(f"<4s4xQQQ{n}Q", b"##DL", 40 + 16 * n, n + 1, 0, *self._links)
        content += struct.pack(f"<B3xI{n}Q", 0, n, *self._offsets)
        self.writer.file.seek(self._list_at)
        self.writer.file.write(content)

    def close(self) -> None:
        """Write what is known at the end only: the list, and the number of records."""
        if self._lists:
            self._close_list()
        self.writer.patch(self.cycles_at, "<Q", self.cycles)

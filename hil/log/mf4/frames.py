"""Writes frames as a sorted MF4 bus log (ASAM bus logging): one group each for data, remote and error frames."""

from collections.abc import Iterable
from datetime import tzinfo
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from hil.log.frames import FD_CODES, FrameFlag, FrameTable, LogFacts
from hil.log.mf4.layout import KINDS
from hil.log.mf4.write import BUS_EVENT, BYTES, UNSIGNED, Channel, GroupWriter, MdfWriter
from hil.log.write import numbered

BLOCK_BYTES = 2 << 20  # of one block of data, not packed
BUS_GROUP = 0x6  # flags of a group: bus events, as they were
CODE_OF = np.minimum(np.searchsorted(FD_CODES, np.arange(256)), 15).astype(np.uint8)
"""DLC by number of bytes; the next longer one for a number that no frame has."""


def write_mf4(file: IO[bytes], tables: Iterable[FrameTable], facts: LogFacts, zone: tzinfo) -> None:
    """Write an MF4 bus log, version 4.11: finalised, sorted, packed; stamps are int64 nanoseconds since the start.

    Memory does not grow with the log.
    """
    start_ns = max(0, facts.least_ns if facts.start_ns is None else facts.start_ns)
    writer = MdfWriter(file, start_ns, "CAN frames")
    source = writer.source("CAN")
    width = 8 if facts.longest <= 8 else 64
    kinds = [0]
    kinds += [flag for flag in (int(FrameFlag.REMOTE), int(FrameFlag.ERROR)) if facts.flags & flag]
    groups = {kind: _Kind(writer, source, kind, width) for kind in kinds}
    for table, number in numbered(tables, facts):
        kind_of = table.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)
        kind_of[(kind_of & FrameFlag.ERROR) != 0] = FrameFlag.ERROR
        for kind, group in groups.items():
            rows = kind_of == kind
            if rows.all():
                group.add(table, number, start_ns)
            elif rows.any():
                group.add(table.take(rows), number[rows], start_ns)
    for group in groups.values():
        group.close()


class _Kind:
    """Frames of one kind, on their way into a group."""

    def __init__(self, writer: MdfWriter, source: int, kind: int, width: int) -> None:
        self.remote = bool(kind & FrameFlag.REMOTE)
        name = KINDS[1 if self.remote else 2 if kind else 0]
        self.width = 0 if self.remote else width
        # one byte is left free: mdfr 0.7.3 does not see a member that begins where the whole frame does
        layout: list[Any] = [("time", "<i8"), ("free", "u1"), ("BusChannel", "u1"), ("ID", "<u4")]
        layout += [(member, "u1") for member in ("IDE", "DLC", "DataLength", "Dir", "EDL", "BRS", "ESI")]
        if not self.remote:
            layout.append(("DataBytes", "u1", (width,)))
        self.dtype = np.dtype(layout)
        members = []
        for member, place in (self.dtype.fields or {}).items():
            if member not in ("time", "free"):
                kind_of_bits = BYTES if member == "DataBytes" else UNSIGNED
                bits = 8 * place[0].itemsize
                members.append(Channel(f"{name}.{member}", kind_of_bits, place[1], bits, flags=BUS_EVENT))
        size = self.dtype.itemsize
        frame = Channel(name, BYTES, 8, 8 * (size - 8), flags=BUS_EVENT, members=members)
        self.group: GroupWriter = writer.group("CAN", source, [frame], size, flags=BUS_GROUP)
        self.rows = max(1, BLOCK_BYTES // size)
        self.records: npt.NDArray[np.void] = np.zeros(self.rows, self.dtype)
        self.n = 0

    def add(self, table: FrameTable, number: npt.NDArray[np.uint8], start_ns: int) -> None:
        """Add frames; ``number`` is the number of each one's channel, from 1."""
        done = 0
        while done < len(table):
            part = slice(done, done + min(self.rows - self.n, len(table) - done))
            self._fill(table.take(part), number[part], start_ns)
            done = part.stop
            if self.n == self.rows:
                self.group.write(self.records.tobytes())
                self.n = 0

    def _fill(self, table: FrameTable, number: npt.NDArray[np.uint8], start_ns: int) -> None:
        records = self.records[self.n : self.n + len(table)]
        self.n += len(table)
        records["time"] = table.time_ns - start_ns
        records["BusChannel"] = number
        records["ID"] = table.can_id
        records["IDE"] = table.extended
        records["DLC"] = CODE_OF[table.length]
        records["DataLength"] = table.length
        for member, flag in (
            ("Dir", FrameFlag.SENT),
            ("EDL", FrameFlag.FD),
            ("BRS", FrameFlag.BIT_RATE_SWITCH),
            ("ESI", FrameFlag.ERROR_STATE),
        ):
            records[member] = (table.flags & flag) != 0
        if not self.remote:
            have = min(self.width, table.data.shape[1])
            data = records["DataBytes"]
            data[:, :have] = table.data[:, :have]
            data[:, have:] = 0

    def close(self) -> None:
        """Write what is left."""
        if self.n:
            self.group.write(self.records[: self.n].tobytes())
        self.group.close()

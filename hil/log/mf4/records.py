"""Records of an MDF 4 file to columns of frames: strided views of whole blocks of records, no loop over frames."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FD_CODES, FD_LENGTHS, MAX_EXTENDED_ID, MAX_STANDARD_ID, FrameFlag, FrameTable
from hil.log.mf4.blocks import DamagedError
from hil.log.mf4.fields import KEPT_8, KEPT_64, Bytes, Mask, Numbers, data_bytes, fits, unsigned
from hil.log.mf4.layout import KINDS, VIRTUAL, VLSD, Group, Member
from hil.log.mf4.stamps import Clock, is_time

MAX_CHANNEL = 255
KIND_FLAGS = dict(zip(KINDS, (FrameFlag(0), FrameFlag.REMOTE, FrameFlag.ERROR), strict=True))
CLASSICAL_OF_CODE = np.minimum(np.arange(16), 8).astype(np.uint8)
FD_OF_CODE = np.array(FD_CODES, np.uint8)
FD_LENGTH = np.isin(np.arange(256), list(FD_LENGTHS))
SHOWN_BYTES = 32
_READ = ("BusChannel", "ID", "IDE", "DLC", "DataLength", "DataBytes", "Dir", "EDL", "BRS", "ESI")


class OffsetOf(Protocol):
    """Where in the file a row stands."""

    def __call__(self, row: int) -> int:
        """Byte offset."""
        ...


class ValueStore(Protocol):
    """Values of variable length, found by their offsets."""

    def values(self, offsets: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.int64], Bytes]:
        """Lengths (n,), -1 where there is no such value, and the first 64 bytes (n, 64), zero behind the length."""
        ...


class Channels:
    """Bus channel numbers of the file to channels of the tables, in the order in which they appear.

    Attributes
    ----------
    first : number of the first channel; 1, or 0 in a file that counts from 0.
    """

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self.first = 1
        self._index = np.full(MAX_CHANNEL + 1, -1, np.int32)

    def numbered(self, table: FrameTable) -> FrameTable:
        """Return a table that has bus channel numbers with the channels that these are."""
        channel = self._of(table.channel)
        return FrameTable(
            self.names, table.time_ns, channel, table.can_id, table.extended, table.length, table.data, table.flags
        )

    def _of(self, numbers: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        found = self._index[numbers]
        if len(found) and int(found.min()) < 0:
            new, where = np.unique(numbers[found < 0], return_index=True)
            for number in new[np.argsort(where)].tolist():
                name = f"can{max(0, number - self.first)}"
                if name not in self.names:
                    self.names += (name,)
                self._index[number] = self.names.index(name)
            found = self._index[numbers]
        return found


class Layout:
    """How the records of one group become frames.

    Parameters
    ----------
    group : of CAN frames.
    master : channel of the time.
    time_bytes : size of the records that it stands in.
    start_ns : start time of the file.
    zeros : records of zeros only are no frames.

    Raises
    ------
    DamagedError
        When its records cannot be frames: what is missing.
    """

    def __init__(
        self, group: Group, master: Member | None, time_bytes: int, start_ns: int, account: Account, zeros: bool
    ) -> None:
        self.group = group
        self.members = group.members
        self.account = account
        self.zeros = zeros
        self.kind_flags = KIND_FLAGS[group.kind]
        self.size = group.data_bytes + group.inval_bytes
        self.rows = 0  # so far
        wanted = {"CAN_DataFrame": ("ID", "DataBytes"), "CAN_RemoteFrame": ("ID",)}.get(group.kind, ())
        missing = [name for name in wanted if name not in group.members]
        if missing:
            raise DamagedError(group.address, f"{group.kind} without {' and '.join(missing)}")
        if master is None or not is_time(master, time_bytes):
            raise DamagedError(group.address, f"{group.kind} without a time that can be read")
        self.clock = Clock(master, start_ns)
        for name, member in group.members.items():
            if name in _READ and not fits(member, group.data_bytes, name == "DataBytes"):
                raise DamagedError(group.address, f"{group.kind}.{name} of {member.bits} bits at byte {member.byte}")
        self.data = group.members.get("DataBytes")
        self.width = min(64, self.data.bits // 8) if self.data is not None else 0
        if self.data is not None and self.data.kind == VLSD:
            self.width = 64

    def frames(
        self, records: Bytes, store: ValueStore | None, times: Bytes | None, offset_of: "OffsetOf"
    ) -> FrameTable:
        """Frames of records (n, size), with bus channel numbers in place of the channels; what is none is rejected.

        Parameters
        ----------
        times : records of the group that holds the time, where it is another one.
        """
        n = len(records)
        time_ns, good = self.clock.stamps(records if times is None else times, self.rows)
        raw = self._column(records, "ID")
        can_id = np.zeros(n, np.uint32) if raw is None else raw.astype(np.uint32)
        if raw is not None and raw.dtype.itemsize > 4:
            good &= (raw >> np.array(32, raw.dtype)) == 0
        wide = can_id > 0x7FFF_FFFF
        can_id &= np.uint32(0x7FFF_FFFF)
        ide = self._column(records, "IDE")
        if ide is not None:
            wide |= ide != 0
        elif raw is not None:
            wide |= can_id > MAX_STANDARD_ID
        error = self.group.kind == "CAN_ErrorFrame"
        good &= can_id <= (MAX_EXTENDED_ID if error else np.where(wide, MAX_EXTENDED_ID, MAX_STANDARD_ID))
        if error:
            wide[:] = False

        edl, flags = self._flags(records, n)
        length, data = self._payload(records, store, edl, flags, good)

        number = self._column(records, "BusChannel")
        if number is None:
            bus = np.full(n, self.group.channel, np.int32)
        else:
            good &= number <= MAX_CHANNEL
            bus = number.astype(np.uint8).astype(np.int32)
        if self.group.frame is not None and self.group.frame.invalid_bit is not None:
            good &= self._valid(records, self.group.frame.invalid_bit)
        if self.zeros:
            good &= ~self._empty(records, can_id, bus)
        table = FrameTable((), time_ns, bus, can_id, wide, length, data, flags)
        self.rows += n
        if good.all():
            return table
        self._reject(records, good, offset_of)
        return table.take(good)

    def _reject(self, records: Bytes, good: Mask, offset_of: "OffsetOf") -> None:
        bad = np.flatnonzero(~good)
        for row in bad[:10].tolist():
            shown = records[row, :SHOWN_BYTES].tobytes().hex()
            self.account.reject(offset_of(row), f"{self.group.kind} {shown}")
        self.account.rejected += max(0, len(bad) - 10)

    def _empty(self, records: Bytes, can_id: npt.NDArray[np.uint32], bus: npt.NDArray[np.int32]) -> Mask:
        """Records of zeros: space that a logger without power had set aside, or never written sectors."""
        empty: Mask = (can_id == 0) & (bus == 0)
        rows = np.flatnonzero(empty)
        if len(rows):
            empty[rows] = np.logical_not(records[rows].any(1))
        return empty

    def _valid(self, records: Bytes, bit: int) -> Mask:
        byte = self.group.data_bytes + bit // 8
        if bit < 0 or byte >= records.shape[1]:  # all invalid; or the bits are kept apart
            return np.full(len(records), bit >= 0)
        valid: Mask = (records[:, byte] >> np.uint8(bit % 8)) & np.uint8(1) == 0
        return valid

    def _column(self, records: Bytes, name: str) -> Numbers | None:
        """Unsigned values of a member, in the narrowest type that holds its bytes; None where it is missing."""
        member = self.members.get(name)
        if member is None:
            return None
        if member.kind == VIRTUAL or not member.bits:
            first = self.rows if member.kind == VIRTUAL else 0
            raw: Numbers = np.arange(first, first + len(records), dtype=np.uint64) * np.uint64(member.kind == VIRTUAL)
        else:
            raw = unsigned(records, member)
        if member.factor != 1 or member.offset:
            factor, offset = int(member.factor), int(member.offset)
            raw = (raw.astype(np.uint64) * np.uint64(factor) + np.uint64(offset)).astype(np.uint64)
        return raw

    def _flags(self, records: Bytes, n: int) -> tuple[Mask | None, npt.NDArray[np.uint8]]:
        flags = np.full(n, int(self.kind_flags), np.uint8)
        direction = self._column(records, "Dir")
        if direction is not None:
            flags |= (direction == 1).view(np.uint8) << np.uint8(5)
        raw = self._column(records, "EDL")
        if raw is None:
            return None, flags
        edl: Mask = raw != 0
        if edl.any():
            flags |= edl.view(np.uint8) << np.uint8(2)
            for name, shift in (("BRS", 3), ("ESI", 4)):
                bit = self._column(records, name)
                if bit is not None:
                    flags |= ((bit != 0) & edl).view(np.uint8) << np.uint8(shift)
        return edl, flags

    def _payload(
        self, records: Bytes, store: ValueStore | None, edl: Mask | None, flags: npt.NDArray[np.uint8], good: Mask
    ) -> tuple[npt.NDArray[np.uint8], Bytes]:
        """Lengths and data; what has a length that no frame has is taken out of ``good``."""
        n = len(records)
        remote = self.group.kind == "CAN_RemoteFrame"
        code, stated = self._column(records, "DLC"), self._column(records, "DataLength")
        held: npt.NDArray[np.int64] | int = self.width
        content: Bytes | None = None
        if self.data is not None and not remote:
            if self.data.kind == VLSD:
                assert store is not None
                held, content = store.values(unsigned(records, self.data).astype(np.uint64))
                good &= held >= 0
            else:
                content = data_bytes(records, self.data, self.width)
        if stated is not None and not (remote and code is not None):
            length = np.minimum(stated, np.array(255, stated.dtype)).astype(np.uint8)
        elif code is not None and (remote or not isinstance(held, np.ndarray)):
            length = self._by_code(code, edl, good)
        else:
            length = np.clip(held, 0, 64).astype(np.uint8) + np.zeros(n, np.uint8)
        longest = int(length.max()) if n else 0
        if longest > 8:
            fd = (flags & FrameFlag.FD) != 0
            if edl is None and not remote:
                fd = length > 8
                flags |= fd.view(np.uint8) << np.uint8(2)
            elif code is not None and not remote:  # a classical DLC of 9 to 15 that was entered as the length, too
                length[(length > 8) & (length < 16) & ~fd & (code == length)] = 8
            good &= np.where(fd, FD_LENGTH[length], length <= 8)
        if remote or content is None:
            if not remote:
                good &= length == 0
            return length, np.zeros((n, 8), np.uint8)
        if longest > self.width or isinstance(held, np.ndarray):
            good &= length <= held
        return length, _masked(content, length, longest > 8)

    def _by_code(self, code: Numbers, edl: Mask | None, good: Mask) -> npt.NDArray[np.uint8]:
        good &= code < np.array(16, code.dtype)
        narrow = (code & np.array(15, code.dtype)).astype(np.uint8)
        if edl is None:
            lengths = CLASSICAL_OF_CODE if self.width <= 8 else FD_OF_CODE
            found: Bytes = lengths[narrow]
        else:
            found = np.where(edl, FD_OF_CODE[narrow], CLASSICAL_OF_CODE[narrow])
        return found


def _masked(content: Bytes, length: npt.NDArray[np.uint8], wide: bool) -> Bytes:
    """Rows of 8 or 64 bytes, zero behind the length."""
    n, width = content.shape
    size = 64 if wide else 8
    if width >= size:
        words = content[:, :size].view(np.uint64).copy()
    else:
        words = np.zeros((n, size // 8), np.uint64)
        words.view(np.uint8)[:, :width] = content
    if wide:
        words &= KEPT_64[np.minimum(length, 64)]
    elif n and int(length.min()) < 8:
        words[:, 0] &= np.take(KEPT_8, length, mode="clip")
    return words.view(np.uint8)

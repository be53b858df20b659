"""Frames of one sorted group of an MDF 4 file, block of records by block of records."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FrameTable
from hil.log.mf4.blocks import DamagedError, MdfFile
from hil.log.mf4.data import DataStream
from hil.log.mf4.fields import Bytes
from hil.log.mf4.layout import CYCLES_OPEN, MAX_RECORD_BYTES, VLSD, DataGroup, Group
from hil.log.mf4.records import Layout
from hil.log.mf4.values import SignalData


@dataclass(frozen=True, slots=True)
class Share:
    """What one of several data groups that are read side by side may keep in memory.

    Attributes
    ----------
    rows : records that become frames at once.
    size : bytes of records, and of values of variable length.
    waiting : frames of an unsorted group that wait for earlier ones.
    """

    rows: int
    size: int
    waiting: int

    def records(self, stride: int) -> int:
        """Records of one block."""
        return max(1, min(self.rows, self.size // stride))


class RecordStream:
    """Whole records of one size, out of a stream of bytes.

    Parameters
    ----------
    stride : bytes of a record, with its id.
    rows : most records at once.
    """

    def __init__(self, stream: DataStream, stride: int, rows: int, account: Account) -> None:
        self.stream = stream
        self.stride = stride
        self.account = account
        self.buffer: npt.NDArray[np.uint8] = np.zeros(stride * rows, np.uint8)
        self.position = 0  # in the stream, of the first record given last
        self.count = 0  # records given
        self.lost = False

    def read(self, most: int | None = None) -> Bytes | None:
        """Next records (n, stride), in a buffer that the next call writes over; None at the end."""
        stream, stride = self.stream, self.stride
        size = len(self.buffer) if most is None else min(len(self.buffer), most * stride)
        view = self.buffer.data[:size]
        have = 0
        while True:
            begin = stream.position - have
            have += stream.fill(view[have:])
            whole, rest = divmod(have, stride)
            if whole and not rest:
                break
            if stream.gap is not None:
                gap = stream.pass_over()
                self.lost = True
                self.account.reject(gap.offset, gap.problem)
                if gap.length is not None:
                    self._skip(-(rest + gap.length) % stride)
                if whole:
                    break
                have = 0
            elif have < size:
                if rest:
                    at = stream.offset_of(begin + whole * stride)
                    self.account.reject(at, self.buffer[whole * stride : have][:32].tobytes().hex())
                    self.account.cut_at(at)
                elif stream.cut:
                    self.account.cut_at(stream.mdf.size)
                if whole:
                    break
                return None
        stream.forget(begin)
        self.position = begin
        self.count += whole
        return self.buffer[: whole * stride].reshape(whole, stride)

    def _skip(self, n: int) -> None:
        while n:
            got = self.stream.fill(memoryview(bytearray(min(n, 65_536))))
            if not got:
                return
            n -= got

    def offset_of(self, row: int) -> int:
        """Where in the file a record given last stands."""
        return self.stream.offset_of(self.position + row * self.stride)


def sorted_frames(
    mdf: MdfFile,
    data: DataGroup,
    group: Group,
    share: Share,
    account: Account,
    master_of: tuple[DataGroup, Group] | None,
) -> Iterator[FrameTable]:
    """Yield the frames of the only group of a data group.

    Parameters
    ----------
    share : of the memory.
    master_of : the group that holds the time, where it is another one.

    Raises
    ------
    DamagedError
        When its records cannot be frames.
    """
    timed = group if master_of is None else master_of[1]
    layout = Layout(group, timed.master, timed.data_bytes, mdf.start_ns, account, not mdf.finalised)
    stream = DataStream(mdf, data.data)
    apart = _bits_apart(mdf, data.data)
    stride = _stride(data, group, apart)
    reader = RecordStream(stream, stride, share.records(stride), account)
    store = None
    if layout.data is not None and layout.data.kind == VLSD:
        store = SignalData(DataStream(mdf, layout.data.data), account, share.size)
    other = None
    if master_of is not None:
        time_data, time_group = master_of
        time_stride = _stride(time_data, time_group, _bits_apart(mdf, time_data.data))
        other = RecordStream(DataStream(mdf, time_data.data), time_stride, share.records(stride), account)
    try:
        while (records := reader.read()) is not None:
            times = None
            if other is not None:
                times = other.read(len(records))
                n = 0 if times is None else len(times)
                if n < len(records):
                    account.reject(reader.offset_of(n), f"{len(records) - n} {group.kind} without a time")
                    records = records[:n]
                if times is None:
                    break
                times = times[:, time_data.id_bytes :]
            records = _of_group(records, data.id_bytes, group, account, reader)
            yield layout.frames(records, store, times, reader.offset_of)
    finally:
        stream.close()
        if store is not None:
            store.stream.close()
        if other is not None:
            other.stream.close()
    whole = not (reader.lost or stream.cut or mdf.unfinalised & CYCLES_OPEN)
    if whole and reader.count != group.cycles:
        account.reject(group.address, f"{group.kind}: {group.cycles} records are stated, the data hold {reader.count}")


def _stride(data: DataGroup, group: Group, apart: bool) -> int:
    stride = data.id_bytes + group.data_bytes + (0 if apart else group.inval_bytes)
    if not 0 < stride <= MAX_RECORD_BYTES:
        raise DamagedError(group.address, f"records of {stride} bytes; 1 to {MAX_RECORD_BYTES} are read")
    return stride


def _bits_apart(mdf: MdfFile, link: int) -> bool:
    """Invalidation bits stand in blocks of their own (MDF 4.20)."""
    try:
        return bool(link) and mdf.ident_at(link)[0] in (b"LD", b"DV")
    except DamagedError:
        return False


def _of_group(records: Bytes, id_bytes: int, group: Group, account: Account, reader: RecordStream) -> Bytes:
    """Records without their id; those with another id are rejected."""
    if not id_bytes:
        return records
    wanted = np.frombuffer((group.record_id & (2 ** (8 * id_bytes) - 1)).to_bytes(id_bytes, "little"), np.uint8)
    right = (records[:, :id_bytes] == wanted).all(1)
    if not right.all():
        bad = np.flatnonzero(~right)
        for row in bad[:10].tolist():
            account.reject(reader.offset_of(row), f"record id {records[row, :id_bytes].tobytes().hex()}")
        account.rejected += max(0, len(bad) - 10)
        records = records[right]
    return records[:, id_bytes:]

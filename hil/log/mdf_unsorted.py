"""Frames of an unsorted data group of an MDF 4 file: records of several groups in one stream, as they were written."""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FrameTable
from hil.log.mdf_blocks import CYCLES_OPEN, VLSD, VLSD_OFFSETS_OPEN, DamagedError, DataGroup, MdfFile
from hil.log.mdf_data import DataStream
from hil.log.mdf_fields import Bytes, unsigned
from hil.log.mdf_merge import Reordering
from hil.log.mdf_records import Layout
from hil.log.mdf_scan import FULL, UNKNOWN, scan_records
from hil.log.mdf_sorted import OPEN_NOTE, Share
from hil.log.mdf_values import BATCH_ROWS, SignalData, Values, numbers_at

BLOCK_BYTES = 2 << 20
FEW_BYTES = 200_000  # below this the scan is not compiled
MAX_VALUE_BYTES = 16 << 20  # of one record


@cache
def _compiled_scan() -> Callable[..., tuple[int, int, int]]:
    from hil.log.compiled import compiled

    scan: Callable[..., tuple[int, int, int]] = compiled(scan_records)
    return scan


class _StreamValues:
    """Values of variable length that stand in the same stream, as records of a group of their own.

    Parameters
    ----------
    in_order : the offsets in the records were left open by the writer: values follow in the order of the records.
    """

    def __init__(self, most: int, in_order: bool) -> None:
        self.window = Values(most)
        self.in_order = in_order
        self.starts: npt.NDArray[np.int64] = np.zeros(0, np.int64)

    def add(self, buffer: Bytes, begin: npt.NDArray[np.int64], size: npt.NDArray[np.int64]) -> None:
        """Add values, each with its 4 bytes of length."""
        first = self.window.end
        ends = np.cumsum(size)
        total = int(ends[-1]) if len(ends) else 0
        room = np.frombuffer(self.window.room(total), np.uint8)
        target = ends - size
        for n in np.unique(size).tolist():
            same = size == n
            whole = _pieces(room, n)
            whole[target[same]] = _pieces(buffer, n)[begin[same]]
        self.window.end += total
        if self.in_order:
            self.starts = np.concatenate((self.starts, first + target))

    def ready(self, offsets: npt.NDArray[np.uint64], last: bool) -> int:
        """How many of the records in a row have their values."""
        if last:
            return len(offsets)
        if self.in_order:
            return min(len(offsets), len(self.starts))
        end = self.window.end
        waiting = np.flatnonzero((offsets + np.uint64(4) > end) & (offsets < end + self.window.most))
        return int(waiting[0]) if len(waiting) else len(offsets)

    def values(self, offsets: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.int64], Bytes]:
        """See `hil.log.mdf_records.ValueStore`."""
        n = len(offsets)
        lengths = np.full(n, -1, np.int64)
        data = np.zeros((n, 64), np.uint8)
        rows = np.arange(n)
        at = np.minimum(offsets, np.uint64(2**62)).astype(np.int64)
        if self.in_order:
            at, self.starts = self.starts[:n], self.starts[n:]
            rows = rows[: len(at)]
        for begin in range(0, len(rows), BATCH_ROWS):
            part = slice(begin, begin + BATCH_ROWS)
            self.window.take(at[part], rows[part], lengths, data)
        return lengths, data


def _pieces(content: Bytes, n: int) -> npt.NDArray[np.void]:
    """Pieces of ``n`` bytes that begin at every byte."""
    return np.ndarray(max(0, len(content) - n + 1), f"V{n}", content, 0, 1)


class _Part:
    """One group of CAN frames in the stream."""

    def __init__(self, layout: Layout, values: _StreamValues | SignalData | None) -> None:
        self.layout = layout
        self.values = values
        self.count = 0
        self.records: Bytes = np.zeros((0, layout.size), np.uint8)
        self.offsets: npt.NDArray[np.int64] = np.zeros(0, np.int64)  # in the file

    def add(self, buffer: Bytes, begin: npt.NDArray[np.int64], offsets: npt.NDArray[np.int64]) -> None:
        """Add records, and where they stand in the file."""
        records = _pieces(buffer, self.layout.size)[begin].view(np.uint8).reshape(-1, self.layout.size)
        self.count += len(records)
        self.records = np.concatenate((self.records, records)) if len(self.records) else records
        self.offsets = np.concatenate((self.offsets, offsets)) if len(self.offsets) else offsets

    def frames(self, last: bool) -> FrameTable | None:
        """Frames of the records whose values are there; of all of them at the ``last`` call."""
        n = len(self.records)
        if isinstance(self.values, _StreamValues) and n:
            assert self.layout.data is not None
            last = last or n * self.layout.size > self.values.window.most
            n = self.values.ready(unsigned(self.records, self.layout.data).astype(np.uint64), last)
        if not n:
            return None
        records, where = self.records[:n], self.offsets
        self.records, self.offsets = self.records[n:], self.offsets[n:]
        return self.layout.frames(records, self.values, None, lambda row: int(where[row]))


def unsorted_frames(
    mdf: MdfFile, data: DataGroup, share: Share, account: Account, compiled: bool | None
) -> Iterator[FrameTable]:
    """Yield the frames of all groups of a data group, by time.

    Parameters
    ----------
    share : of the memory.
    compiled : whether the scan for records is compiled; None compiles it for all but small files.
    """
    reader = _Scanner(mdf, data, share, account, compiled)
    order = Reordering(max(share.rows, 4)) if len(reader.parts) > 1 else None
    for last in reader.steps():
        for k, part in reader.parts.items():
            table = part.frames(last)
            if table is None:
                continue
            if order is None:
                yield table
            else:
                order.add(table, k)
        if order is not None:
            yield from order.take(last)


class _Scanner:
    """Reads the stream block by block, and hands the records to their groups."""

    def __init__(self, mdf: MdfFile, data: DataGroup, share: Share, account: Account, compiled: bool | None) -> None:
        self.mdf = mdf
        self.data = data
        self.account = account
        self.compiled = mdf.size > FEW_BYTES if compiled is None else compiled
        self.parts: dict[int, _Part] = {}
        self.values: dict[int, _StreamValues] = {}
        groups = sorted({group.record_id: group for group in data.groups}.values(), key=lambda g: g.record_id)
        if len(groups) < len(data.groups):
            account.reject(data.address, "several groups have one record id")
        self.groups = groups
        in_order = bool(mdf.unfinalised & VLSD_OFFSETS_OPEN)
        by_address = {group.address: k for k, group in enumerate(groups) if group.vlsd}
        most = max(share.size, 1 << 20)
        for k, group in enumerate(groups):
            if not group.kind or group.vlsd:
                continue
            try:
                layout = Layout(group, group.master, group.data_bytes, mdf.start_ns, account, not mdf.finalised)
            except DamagedError as error:
                account.reject(error.offset, error.problem)
                continue
            values: _StreamValues | SignalData | None = None
            if layout.data is not None and layout.data.kind == VLSD:
                own = by_address.get(layout.data.data)
                if own is None:
                    values = SignalData(DataStream(mdf, layout.data.data), account, most)
                else:
                    values = self.values[own] = _StreamValues(most, in_order)
            self.parts[k] = _Part(layout, values)
        self.ids = np.array([group.record_id for group in groups], np.uint64)
        self.sizes = np.array([-1 if g.vlsd else g.data_bytes + g.inval_bytes for g in groups], np.int64)
        self.stream = DataStream(mdf, data.data)
        self.lost = False
        self.aligned = True  # blocks of data begin with a record

    def steps(self) -> Iterator[bool]:
        """Read on, block by block; yields True at the end."""
        buffer: npt.NDArray[np.uint8] = np.zeros(BLOCK_BYTES, np.uint8)
        scan = _compiled_scan() if self.compiled else scan_records
        most = len(buffer) // (self.data.id_bytes + 1)
        most = min(most, 1 << 17)
        numbers, begins = np.zeros(most, np.int32), np.zeros(most, np.int64)
        have = 0
        stream = self.stream
        while True:
            first = stream.position - have
            got = stream.fill(buffer.data[have:])
            have += got
            n, at, why = scan(buffer, have, self.data.id_bytes, self.ids, self.sizes, numbers, begins)
            self._hand_out(buffer[:have], numbers[:n], begins[:n], first)
            starts = stream.starts_between(first, first + at) - first
            self.aligned = self.aligned and bool(np.isin(starts, begins[:n] - self.data.id_bytes).all())
            stream.forget(first)
            yield False
            if why == UNKNOWN:
                self._lose(stream, buffer, first, at, have)
                have = 0
                continue
            have -= at
            buffer[:have] = buffer[at : at + have].copy()
            if why == FULL:
                continue
            if stream.gap is not None:
                gap = stream.pass_over()
                self.account.reject(gap.offset, gap.problem)
                self.lost = True
                have = 0
            elif have == len(buffer):
                if len(buffer) < MAX_VALUE_BYTES:
                    buffer = np.concatenate((buffer, np.zeros(len(buffer), np.uint8)))
                    continue
                self._lose(stream, buffer, first + at, 0, have)
                have = 0
            elif not got:
                break
        end = stream.position - have
        if have:
            self.account.reject(stream.offset_of(end), buffer[: min(have, 32)].tobytes().hex())
            self.account.cut_at(stream.offset_of(end))
        elif stream.cut:
            self.account.cut_at(self.mdf.size)
        yield True
        self._close()

    def _lose(self, stream: DataStream, buffer: Bytes, first: int, at: int, have: int) -> None:
        """An id that no group has: the next record is the first of the next block, if blocks begin with one."""
        offset = stream.offset_of(first + at)
        self.account.reject(offset, f"no record: {buffer[at : min(have, at + 32)].tobytes().hex()}")
        self.lost = True
        if self.aligned:
            stream.next_block()
        else:
            self.account.note("records behind a damaged one are lost: where they begin, nobody knows")
            stream.end()

    def _hand_out(
        self, buffer: Bytes, numbers: npt.NDArray[np.int32], begins: npt.NDArray[np.int64], first: int
    ) -> None:
        id_bytes = self.data.id_bytes
        for k, values in self.values.items():
            begin = begins[numbers == k]
            if len(begin):
                values.add(buffer, begin, 4 + numbers_at(buffer, "<u4", begin).astype(np.int64))
        for k, part in self.parts.items():
            begin = begins[numbers == k]
            if len(begin):
                part.add(buffer, begin, self.stream.offsets_of(first + begin - id_bytes))

    def _close(self) -> None:
        self.stream.close()
        if self.stream.open_end:
            self.account.note(OPEN_NOTE)
        if self.lost or self.stream.cut or self.mdf.unfinalised & CYCLES_OPEN:
            return
        for k, part in self.parts.items():
            stated = self.groups[k].cycles
            if part.count != stated:
                problem = f"{self.groups[k].kind}: {stated} records are stated, the data hold {part.count}"
                self.account.reject(self.groups[k].address, problem)

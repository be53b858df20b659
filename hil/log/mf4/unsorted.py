"""Frames of an unsorted data group of an MDF 4 file: records of several groups in one stream, as they were written."""

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import numpy.typing as npt

from hil.log.account import Account
from hil.log.frames import FrameTable
from hil.log.mf4.blocks import DamagedError, MdfFile
from hil.log.mf4.data import DataStream
from hil.log.mf4.fields import Bytes, unsigned
from hil.log.mf4.layout import CYCLES_OPEN, VLSD, VLSD_OFFSETS_OPEN, DataGroup
from hil.log.mf4.merge import Reordering
from hil.log.mf4.records import Layout
from hil.log.mf4.scan import END, UNKNOWN, scan_records
from hil.log.mf4.sorted_group import Share
from hil.log.mf4.values import BATCH_ROWS, SignalData, Values, numbers_at

BLOCK_BYTES = 2 << 20
MAX_FOUND = 1 << 17  # records that one scan finds
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
        self.broken = False  # bytes of the stream were lost; what follows can no longer be found

    def add(self, buffer: Bytes, begin: npt.NDArray[np.int64], size: npt.NDArray[np.int64]) -> None:
        """Add values, each with its 4 bytes of length."""
        if self.broken:
            return
        first = self.window.end
        ends = np.cumsum(size)
        total = int(ends[-1]) if len(ends) else 0
        room = np.frombuffer(self.window.room(total), np.uint8)
        target = ends - size
        for n in _distinct(size):
            same = size == n
            whole = _pieces(room, n)
            whole[target[same]] = _pieces(buffer, n)[begin[same]]
        self.window.end += total
        if self.in_order:
            self.starts = np.concatenate((self.starts, first + target))

    def ready(self, offsets: npt.NDArray[np.uint64]) -> int:
        """How many of the records in a row wait for their values no longer."""
        if self.broken:
            return len(offsets)
        if self.in_order:
            return min(len(offsets), len(self.starts))
        end = self.window.end
        waiting = np.flatnonzero((offsets + np.uint64(4) > end) & (offsets < end + self.window.most))
        return int(waiting[0]) if len(waiting) else len(offsets)

    def values(self, offsets: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.int64], Bytes]:
        """See `hil.log.mf4.records.ValueStore`."""
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


def _distinct(sizes: npt.NDArray[np.int64]) -> list[int]:
    if not len(sizes):
        return []
    if int(sizes.max()) > BLOCK_BYTES:
        return sorted(set(sizes.tolist()))
    return np.flatnonzero(np.bincount(sizes)).tolist()


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
            ready = self.values.ready(unsigned(self.records, self.layout.data).astype(np.uint64))
            if last and ready < n:
                self.layout.account.cut_at(int(self.offsets[ready]))
            elif n * self.layout.size <= self.values.window.most:
                n = ready
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
    order = Reordering(share.waiting) if len(reader.parts) > 1 else None
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
        by_id = {group.record_id: group for group in data.groups if group.vlsd or group.data_bytes + group.inval_bytes}
        groups = sorted(by_id.values(), key=lambda g: g.record_id)
        if len(groups) < len(data.groups):
            account.reject(data.address, "several groups have one record id, or records of no bytes")
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
        most = min(max(1, BLOCK_BYTES // (data.id_bytes + 1)), MAX_FOUND)
        self.numbers: npt.NDArray[np.int32] = np.zeros(most, np.int32)
        self.begins: npt.NDArray[np.int64] = np.zeros(most, np.int64)

    def steps(self) -> Iterator[bool]:
        """Read on, block by block; yields True at the end."""
        buffer: npt.NDArray[np.uint8] = np.zeros(BLOCK_BYTES, np.uint8)
        stream = self.stream
        low = have = 0  # what is held: buffer[low:have]
        while True:
            if low:
                have -= low
                buffer[:have] = buffer[low : low + have].copy()
            got = stream.fill(buffer.data[have:])
            have += got
            first = stream.position - have
            low = 0
            while low < have:
                at, why = self._scan(buffer[low:have], first + low)
                yield False
                low += at
                if why == UNKNOWN:
                    low = self._behind(buffer[low : low + 32], first, low, have)
                elif why == END:
                    break
            stream.forget(first + low)
            if stream.gap is not None:
                gap = stream.pass_over()
                self.account.reject(gap.offset, gap.problem)
                self._lose()
                low = have = 0
            elif low == 0 and have == len(buffer):
                if have < MAX_VALUE_BYTES:
                    buffer = np.concatenate((buffer, np.zeros(have, np.uint8)))
                else:
                    low = self._behind(buffer[:32], first, 0, have)
            elif not got:
                break
        end = stream.offset_of(stream.position - (have - low))
        rest = buffer[low : min(have, low + 32)].tobytes()
        if rest and not self._is_value(rest):  # the frame that waits for a value is the one to be rejected
            self.account.reject(end, rest.hex())
        yield True
        if rest or stream.cut:
            self.account.cut_at(end if rest else self.mdf.size)
        self._close()

    def _scan(self, held: Bytes, position: int) -> tuple[int, int]:
        """Hand the records in what is held to their groups; where they end, and why there."""
        scan = _compiled_scan() if self.compiled else scan_records
        id_bytes = self.data.id_bytes
        n, at, why = scan(held, len(held), id_bytes, self.ids, self.sizes, self.numbers, self.begins)
        begins = self.begins[:n]
        self._hand_out(held, self.numbers[:n], begins, position)
        if self.aligned:
            firsts = np.append(begins - id_bytes, at)  # of the records, ascending
            starts = self.stream.starts_between(position, position + at) - position
            self.aligned = bool((firsts[np.searchsorted(firsts, starts)] == starts).all())
        return int(at), int(why)

    def _behind(self, shown: Bytes, first: int, low: int, have: int) -> int:
        """Where to go on behind an id that no group has: at the next block of data, if blocks begin with a record."""
        stream = self.stream
        self.account.reject(stream.offset_of(first + low), f"no record: {shown.tobytes().hex()}")
        self._lose()
        if not self.aligned:
            self.account.note("records behind a damaged one are lost: where they begin, nobody knows")
            stream.end()
            return have
        starts = stream.starts_between(first + low + 1, first + have)
        if len(starts):
            return int(starts[0]) - first
        stream.next_block()
        return have

    def _is_value(self, record: bytes) -> bool:
        ident = int.from_bytes(record[: self.data.id_bytes], "little")
        return any(self.groups[k].record_id == ident for k in self.values)

    def _lose(self) -> None:
        """Bytes of the stream are lost: offsets of values no longer tell where these are."""
        self.lost = True
        for values in self.values.values():
            values.broken = True

    def _hand_out(
        self, buffer: Bytes, numbers: npt.NDArray[np.int32], begins: npt.NDArray[np.int64], first: int
    ) -> None:
        id_bytes = self.data.id_bytes
        order = np.argsort(numbers, kind="stable")
        counts = np.bincount(numbers, minlength=len(self.groups))
        ends = np.cumsum(counts)
        for k in np.flatnonzero(counts).tolist():
            begin = begins[order[ends[k] - counts[k] : ends[k]]]
            if k in self.values:
                self.values[k].add(buffer, begin, 4 + numbers_at(buffer, "<u4", begin).astype(np.int64))
            elif k in self.parts:
                self.parts[k].add(buffer, begin, self.stream.offsets_of(first + begin - id_bytes))

    def _close(self) -> None:
        self.stream.close()
        if self.lost or self.stream.cut or self.mdf.unfinalised & CYCLES_OPEN:
            return
        for k, part in self.parts.items():
            stated = self.groups[k].cycles
            if part.count != stated:
                problem = f"{self.groups[k].kind}: {stated} records are stated, the data hold {part.count}"
                self.account.reject(self.groups[k].address, problem)

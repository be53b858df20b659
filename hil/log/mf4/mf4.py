"""ASAM MDF 4 bus logs (MF4): reads frames straight from the blocks of records; `write_mf4` writes sorted ones."""

from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import timedelta

from hil.log.account import Account
from hil.log.builder import ROWS
from hil.log.frames import FrameTable, LogError
from hil.log.mf4.blocks import DamagedError, MdfFile
from hil.log.mf4.frames import write_mf4
from hil.log.mf4.layout import DataGroup, Group
from hil.log.mf4.merge import merged
from hil.log.mf4.records import Channels
from hil.log.mf4.sorted_group import Share, sorted_frames
from hil.log.mf4.unsorted import unsorted_frames
from hil.log.mf4.values import STORE_BYTES
from hil.log.source import ReadOptions, Source
from hil.log.wall_clock import EPOCH, wall_clock_ns

__all__ = ["read_mf4", "write_mf4"]

LATEST = 420  # version of MDF that is read
BLOCK_ROWS = ROWS // 2  # records of a group that become frames at once: they fit a cache
MERGED_ROWS = 4 * ROWS  # of all groups together
HELD_BYTES = 64 << 20  # of records and values, of all groups together
LEAST_ROWS, LEAST_BYTES = 64, 4096  # of one group


def read_mf4(source: Source, account: Account, options: ReadOptions) -> Iterator[FrameTable]:
    """Yield the frames of an MF4 bus log, ordered by time over its groups.

    Raises
    ------
    LogError
        When its header is damaged, or it has no group of CAN frames.
    """
    file = source.random_access()
    size = file.seek(0, 2)
    if source.limit_bytes is not None and size > source.limit_bytes:
        size = source.limit_bytes
        account.note(f"only the first {size} bytes are read")
        account.cut_at(size)
    try:
        mdf = MdfFile(file, size, account)
        if mdf.version // 100 != 4:
            version = f"MDF version {mdf.version / 100:.2f}; 4.00 to {LATEST / 100:.2f} are read"
            raise LogError(source.path, f"{version}: convert it to MDF 4")
        mdf.describe()
    except DamagedError as error:
        raise LogError(source.path, f"no header of MDF 4: {error.problem}", error.offset) from error
    if mdf.version > LATEST:
        account.note(f"MDF version {mdf.version / 100:.2f}: what is newer than {LATEST / 100:.2f} in it is not read")
    if not mdf.finalised:
        account.note("an unfinalised file: lengths and counts that its writer left open are taken from the data")
    _start(mdf, account, options)
    found = _groups_of_frames(mdf, source, account)
    if mdf.cut:
        account.cut_at(size)
    channels = Channels()
    tables = (table for table in merged(_readers(mdf, found, account, options), _share(found).rows) if len(table))
    first = next(tables, None)
    if first is None:
        return
    channels.first = min(1, int(first.channel.min()))
    if not channels.first:
        account.note("its bus channels count from 0")
    yield channels.numbered(first)
    for table in tables:
        yield channels.numbered(table)


def _start(mdf: MdfFile, account: Account, options: ReadOptions) -> None:
    """Start time of the file to the account; a wall clock is read in the zone that was chosen."""
    if mdf.start_ns >= 2**62:
        account.note(f"start time of {mdf.start_ns} ns is out of range: stamps count from 1970")
        mdf.start_ns = 0
        return
    if mdf.local_start:
        wall_clock = (EPOCH + timedelta(microseconds=mdf.start_ns // 1000)).replace(tzinfo=None)
        mdf.start_ns = wall_clock_ns(wall_clock, options.timezone, mdf.start_ns % 1000)
        account.local_start = True
    account.start_ns = mdf.start_ns


def _groups_of_frames(mdf: MdfFile, source: Source, account: Account) -> list[tuple[DataGroup, list[Group]]]:
    """Data groups with CAN frames; all others are passed over and counted."""
    found = []
    others: Counter[str] = Counter()
    for data in mdf.groups:
        frames = [group for group in data.groups if group.kind and not group.vlsd]
        others.update(f"{group.holds} groups" for group in data.groups if not group.kind and not group.vlsd)
        if frames:
            found.append((data, frames))
    if not found:
        held = ", ".join(f"{count} {what}" for what, count in others.items()) or "no groups"
        cut = "; the file is cut off" if mdf.cut else ""
        raise LogError(source.path, f"no CAN frames in it (CAN_DataFrame, ...), it holds {held}{cut}; give a bus log")
    account.passed_over.update(others)
    return found


def _share(found: list[tuple[DataGroup, list[Group]]]) -> Share:
    rows, size = MERGED_ROWS // len(found), HELD_BYTES // len(found)
    rows = max(LEAST_ROWS, rows)
    return Share(min(BLOCK_ROWS, rows), max(LEAST_BYTES, min(STORE_BYTES, size)), rows)


def _readers(
    mdf: MdfFile, found: list[tuple[DataGroup, list[Group]]], account: Account, options: ReadOptions
) -> list[Iterable[FrameTable]]:
    by_address = {group.address: (data, group) for data in mdf.groups for group in data.groups}
    share = _share(found)
    readers: list[Iterable[FrameTable]] = []
    for data, frames in found:
        if len(data.groups) == 1:
            group = frames[0]
            master = by_address.get(group.master_link) if group.master_link else None
            readers.append(_guarded(sorted_frames(mdf, data, group, share, account, master), account))
        elif data.id_bytes:
            readers.append(_guarded(unsorted_frames(mdf, data, share, account, options.fast), account))
        else:
            account.reject(data.address, f"{len(data.groups)} groups in one data group, without record ids")
    return readers


def _guarded(tables: Iterator[FrameTable], account: Account) -> Iterator[FrameTable]:
    try:
        yield from tables
    except DamagedError as error:
        account.reject(error.offset, error.problem)

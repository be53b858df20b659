"""Writes frames as a log of any known format."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import UTC, tzinfo
from pathlib import Path

import numpy as np

from hil.log.builder import NAME_BYTES
from hil.log.formats import Format, writable
from hil.log.frames import FrameFlag, FrameTable, LogError, LogFacts

MAX_CHANNEL = 255  # of formats that number their channels


def channel_numbers(channels: tuple[str, ...]) -> list[int]:
    """Numbers (from 0) for formats without channel names: can3 -> 3; where names do not tell, in order."""
    ends = [re.search(r"\d{1,3}$", name) for name in channels]
    numbers = [int(end[0]) for end in ends if end and int(end[0]) < MAX_CHANNEL]
    return numbers if len(set(numbers)) == len(channels) else list(range(len(channels)))


def candump_names(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Channel names as a candump log can hold them.

    A blank, and every letter that is not visible, becomes an underscore; a name is cut to 32 bytes, and one that
    another channel then has as well gets a number behind it.
    """
    held: dict[str, None] = {}
    counts: Counter[str] = Counter()
    for channel in channels:
        plain = name = _cut("".join(c if _held(c) else "_" for c in channel), NAME_BYTES) or "_"
        while name in held:
            counts[plain] += 1
            name = f"{_cut(plain, NAME_BYTES - 8)}_{counts[plain] + 1}"
        held[name] = None
    return tuple(held)


def _held(letter: str) -> bool:
    return letter.isprintable() and not letter.isspace()


def _cut(name: str, size: int) -> str:
    return name.encode()[:size].decode(errors="ignore")


def write_log(frames: FrameTable, path: Path) -> None:
    """Write frames; the suffix names the format.

    Raises
    ------
    LogError
        For an unknown suffix, or frames the format cannot hold.
    """
    write_tables([frames], LogFacts.of([frames]), path, writable(path))


def write_tables(tables: Iterable[FrameTable], facts: LogFacts, path: Path, form: Format, zone: tzinfo = UTC) -> None:
    """Write the tables of a log, in bounded memory.

    Parameters
    ----------
    facts : those of all tables together.
    zone : of the wall clock in the header, where the format has one.

    Raises
    ------
    LogError
        When the format cannot hold the frames: the message says which.
    """
    problem = cannot_hold(facts, form)
    if problem is not None:
        raise LogError(path, problem)
    with path.open("w+b") as file:
        form.write(file, tables, facts, zone)


def cannot_hold(facts: LogFacts, form: Format) -> str | None:
    """Why frames cannot be written in a format at all; None where they can."""
    if not form.channel_names and len(facts.channels) > MAX_CHANNEL:
        return f"{len(facts.channels)} channels; {form.name} numbers at most {MAX_CHANNEL}"
    if not form.errors and facts.errors:
        return f"{form.name} cannot hold the {facts.errors} error frames of this log; choose candump or BLF"
    if not form.fd and facts.flags & FrameFlag.FD:
        return f"{form.name} cannot hold CAN FD frames; choose candump, ASC, BLF or MF4"
    if not form.before_start and facts.least_ns < 0:
        return f"{form.name} cannot hold stamps before 1970 (least: {facts.least_ns / 1e9} s); choose BLF or CSV"
    return None


def losses(facts: LogFacts, form: Format) -> list[str]:
    """What a format keeps less well than the source held it."""
    notes = []
    if not form.channel_names:
        renamed = [
            f"{name} is channel {number + 1}"
            for name, number in zip(facts.channels, channel_numbers(facts.channels), strict=True)
            if name != f"can{number}"
        ]
        if renamed:
            notes.append(f"{form.name} has no channel names: {', '.join(renamed)}")
    if form.name == "candump":
        pairs = zip(facts.channels, candump_names(facts.channels), strict=True)
        replaced = [f"{old!r} is {new}" for old, new in pairs if old != new]
        if replaced:
            notes.append(f"candump has no blanks in channel names, and at most 32 bytes: {', '.join(replaced)}")
    if facts.errors and not form.error_content:
        frames = "the error frame" if facts.errors == 1 else f"the {facts.errors:,} error frames"
        notes.append(f"{form.name} keeps neither class nor data of {frames}")
    if facts.finer_than_us and form.resolution_ns >= 1000:
        notes.append(f"{form.name} keeps stamps to the microsecond")
    if facts.flags & FrameFlag.SENT and not form.sent:
        notes.append(f"{form.name} does not keep whether a frame was sent or received")
    if facts.start_ns is not None and facts.start_ns != facts.first_ns and not form.start_time:
        notes.append(f"{form.name} keeps no start time beside the stamps")
    if form.name == "candump" and facts.finer_than_us:
        notes.append("nine digits of a second: can-utils before 2025-09 and tshark 4.0 do not read those")
    return notes


def kept(table: FrameTable, facts: LogFacts, form: Format) -> FrameTable:
    """The table as a format keeps it: what `losses` names is taken out; channels as `channel_numbers` gives them."""
    channels = table.channels
    if not form.channel_names:
        channels = tuple(f"can{number}" for number in channel_numbers(facts.channels))
    elif form.name == "candump":
        channels = candump_names(channels)
    half = form.resolution_ns // 2
    time_ns = (table.time_ns + half) // form.resolution_ns * form.resolution_ns
    error = (table.flags & FrameFlag.ERROR) != 0
    can_id, length, data, flags = table.can_id, table.length, table.data, table.flags
    if not form.error_content and error.any():
        can_id = np.where(error, 0, can_id).astype(np.uint32)
        length = np.where(error, 0, length).astype(np.uint8)
        data = np.where(error[:, None], 0, data).astype(np.uint8)
        flags = np.where(error, flags & np.uint8(FrameFlag.ERROR | FrameFlag.SENT), flags).astype(np.uint8)
    if not form.sent:
        flags = flags & np.uint8(~FrameFlag.SENT & 0xFF)
    return FrameTable(channels, time_ns, table.channel, can_id, table.extended, length, data, flags)


def numbered(tables: Iterable[FrameTable], facts: LogFacts) -> Iterator[tuple[FrameTable, np.ndarray]]:
    """Yield tables with the channel number (from 1) of each frame, uint8 (n,)."""
    numbers = np.array([*channel_numbers(facts.channels), 0], np.int64) + 1
    for table in tables:
        yield table, numbers[table.channel].astype(np.uint8)

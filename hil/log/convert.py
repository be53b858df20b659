"""Converts a log from one format to another, and reads the result back to compare."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil.log.atomic_write import atomic_write
from hil.log.frames import FrameFlag, FrameTable, LogError, Recording
from hil.log.read import read_log
from hil.log.write import FORMATS, NAMELESS, channel_numbers, write_log

TOLERANCE_NS = 1000  # text formats keep microseconds


@dataclass(frozen=True, slots=True)
class Conversion:
    """A finished conversion: what was read, what the written file was seen to hold, and what a format cannot keep."""

    source: Recording
    path: Path
    frames_written: int
    notes: tuple[str, ...]


def convert(source: Path, target: Path, overwrite: bool = False) -> Conversion:
    """Convert ``source`` to ``target``, formats by suffix; ``target`` appears only when it was read back equal.

    Raises
    ------
    LogError
        When the source cannot be read, the target exists, its format cannot hold the frames, or what was written
        does not read back as the same frames.
    """
    if target.suffix.lower() not in FORMATS:
        raise LogError(target, f"unknown suffix {target.suffix!r}; known are {', '.join(FORMATS)}")
    recording = read_log(source)
    frames = recording.frames
    with atomic_write(target, overwrite) as temporary:
        write_log(frames, temporary)
        back = read_log(temporary)
        difference = _difference(frames, back, target.suffix.lower())
        if difference is not None:
            raise LogError(target, f"{difference}; nothing was kept (choose another format, and please report this)")
    return Conversion(recording, target, len(back.frames), _notes(frames, target.suffix.lower()))


def _notes(frames: FrameTable, form: str) -> tuple[str, ...]:
    notes = []
    if form in NAMELESS:
        renamed = [
            f"{name} is channel {number + 1}"
            for name, number in zip(frames.channels, channel_numbers(frames.channels), strict=True)
            if name != f"can{number}"
        ]
        if renamed:
            notes.append(f"{form} has no channel names: {', '.join(renamed)}")
    errors = int(np.count_nonzero(frames.flags & FrameFlag.ERROR))
    if form == ".asc" and errors:
        notes.append(f".asc keeps neither class nor data of the {errors} error frames")
    if form in (".asc", ".trc", ".parquet") and bool((frames.time_ns % 1000).any()):
        notes.append(f"{form} keeps stamps to the microsecond")
    return tuple(notes)


def _difference(frames: FrameTable, back: Recording, form: str) -> str | None:
    """The first way in which the written log differs, None where it is equal."""
    read = back.frames
    if back.rejected or back.truncated_at is not None or len(read) != len(frames):
        cut = "" if back.truncated_at is None else ", cut off"
        return f"{len(frames)} frames were written, {len(read)} read back ({back.rejected} rejected{cut})"
    if form == ".mf4":  # one group each for data, remote and error frames: the order between them is not kept
        frames, read = _by_kind(frames), _by_kind(read)
    lossy = (frames.flags & FrameFlag.ERROR) != 0 if form == ".asc" else np.zeros(len(frames), np.bool_)
    width = max(frames.data.shape[1], read.data.shape[1])
    pairs: list[tuple[str, npt.NDArray[np.bool_]]] = [
        ("time", np.abs(frames.time_ns - read.time_ns) > TOLERANCE_NS),
        ("flags", frames.flags != read.flags),
        ("channel", _channel_keys(frames, form) != _channel_keys(read, ".log")),
        ("id", (frames.can_id != read.can_id) & ~lossy),
        ("id width", (frames.extended != read.extended) & ~lossy),
        ("length", (frames.length != read.length) & ~lossy),
        ("data", (_wide(frames, width) != _wide(read, width)).any(1) & ~lossy),
    ]
    for what, wrong in pairs:
        rows = np.flatnonzero(wrong)
        if len(rows):
            return f"frame {rows[0]} reads back with another {what} ({len(rows)} frames differ)"
    return None


def _by_kind(frames: FrameTable) -> FrameTable:
    kind = frames.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)
    return frames.take(np.lexsort((np.arange(len(frames)), frames.time_ns // TOLERANCE_NS, kind)))


def _channel_keys(frames: FrameTable, form: str) -> npt.NDArray[np.str_]:
    names = list(frames.channels)
    if form in NAMELESS:
        names = [f"can{number}" for number in channel_numbers(frames.channels)]
    return np.array(names or [""], np.str_)[frames.channel]


def _wide(frames: FrameTable, width: int) -> npt.NDArray[np.uint8]:
    return np.pad(frames.data, ((0, 0), (0, width - frames.data.shape[1])))

"""Writes frames as a log of any known format."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from hil.log.asc import asc_lines
from hil.log.blf import write_blf
from hil.log.candump import candump_lines
from hil.log.flat import csv_lines, write_parquet
from hil.log.frames import FrameFlag, FrameTable, LogError
from hil.log.mdf import write_mdf
from hil.log.trc import trc_lines

FORMATS = (".log", ".asc", ".blf", ".trc", ".mf4", ".csv", ".parquet")
NAMELESS = frozenset({".asc", ".blf", ".trc", ".mf4"})  # channels are numbers there


def channel_numbers(channels: tuple[str, ...]) -> list[int]:
    """Numbers (from 0) for formats without channel names: can3 -> 3; where names do not tell, in order."""
    ends = [re.search(r"\d{1,2}$", name) for name in channels]
    numbers = [int(end[0]) for end in ends if end]
    return numbers if len(set(numbers)) == len(channels) else list(range(len(channels)))


def write_log(frames: FrameTable, path: Path) -> None:
    """Write frames; the suffix names the format.

    Raises
    ------
    LogError
        For an unknown suffix, or frames the format cannot hold.
    """
    form = path.suffix.lower()
    numbers = channel_numbers(frames.channels)
    if form in NAMELESS and numbers and max(numbers) > 254:
        raise LogError(path, f"{len(numbers)} channels; {form} numbers at most 255")
    if form == ".log":
        _write_text(path, candump_lines(frames))
    elif form == ".asc":
        _write_text(path, asc_lines(frames, numbers))
    elif form == ".trc":
        errors = int(np.count_nonzero(frames.flags & FrameFlag.ERROR))
        if errors:
            raise LogError(path, f"TRC cannot hold the {errors} error frames of this log; choose .log or .blf")
        _write_text(path, trc_lines(frames, numbers))
    elif form == ".csv":
        _write_text(path, csv_lines(frames))
    elif form == ".parquet":
        write_parquet(frames, path)
    elif form == ".mf4":
        write_mdf(frames, path, numbers)
    elif form == ".blf":
        write_blf(frames, path, numbers)
    else:
        raise LogError(path, f"unknown suffix {form!r}; known are {', '.join(FORMATS)}")


def _write_text(path: Path, lines: Iterable[str]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(lines)

"""A brake dynamometer's record: CSV with units in the head, refused where it cannot be trusted."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.errors import BrakebenchError

Floats = NDArray[np.float64]

UNITS = {"time": "s", "pressure": "bar", "speed": "m/s", "torque": "N m", "temperature": "degC"}
_RANGES = {
    "pressure": (-2.0, 250.0),
    "speed": (0.0, 80.0),
    "torque": (-500.0, 20000.0),
    "temperature": (-50.0, 1200.0),
}
_SHORTEST_S = 20.0
_FEWEST = 200
_LONGEST_GAP_S = 1.0
_LEAST_STROKE_BAR = 2.0
_SLOWEST_S = 0.05


class RecordError(BrakebenchError):
    """A dynamometer record that cannot be used as it is."""


@dataclass(frozen=True, eq=False)
class Record:
    """What a dynamometer measured, in SI units.

    Attributes
    ----------
    name : file it is from.
    time_s, pressure_pa, speed_mps, torque_nm, temperature_k : (n,) samples; the speed is the sliding speed at the
        effective radius, the torque is positive when it brakes.
    remarks : comment lines at the head of the file.
    averaged : how many samples of the file each sample here is the mean of.
    """

    name: str
    time_s: Floats
    pressure_pa: Floats
    speed_mps: Floats
    torque_nm: Floats
    temperature_k: Floats
    remarks: tuple[str, ...] = ()
    averaged: int = 1


def averaged(record: Record) -> Record:
    """Average a record that was sampled faster than friction and temperature move, to a sample every 50 ms or less."""
    count = int(_SLOWEST_S / float(np.median(np.diff(record.time_s))) + 1e-6)
    if count < 2:
        return record
    blocks = record.time_s.size // count
    columns = (record.time_s, record.pressure_pa, record.speed_mps, record.torque_nm, record.temperature_k)
    means = [column[: blocks * count].reshape(blocks, count).mean(axis=1) for column in columns]
    time, pressure, speed, torque, temperature = means
    return Record(record.name, time - time[0], pressure, speed, torque, temperature, record.remarks, count)


def read_record(path: Path | Traversable) -> Record:
    """Read a record with the columns ``time [s], pressure [bar], speed [m/s], torque [N m], temperature [degC]``.

    The columns may stand in any order and have others beside them; lines that start with ``#`` before the head are
    remarks.

    Raises
    ------
    RecordError
        Unreadable file, missing column, wrong unit, a cell that is no finite number or out of range, time that does
        not increase, a gap above 1 s, less than 20 s or 200 samples, nothing that moves or brakes. It names file,
        line and column.
    """
    remarks, head, rows = _lines(path)
    columns = _columns(str(path), *head)
    values = {name: np.empty(len(rows)) for name in UNITS}
    for index, (line, cells) in enumerate(rows):
        if len(cells) != len(head[1]):
            raise RecordError(
                f"{path}:{line}: expected {len(head[1])} cells as in the head, got {len(cells)}; "
                "separate cells with a comma and write decimals with a point"
            )
        for name, column in columns.items():
            values[name][index] = _number(cells[column], name, f"{path}:{line}: column '{_title(name)}'")
    lines = np.array([line for line, _ in rows], dtype=np.int64)
    _check_time(str(path), values["time"], lines)
    _check_excitation(str(path), values)
    return Record(
        name=path.name,
        time_s=values["time"] - values["time"][0],
        pressure_pa=values["pressure"] * 1e5,
        speed_mps=values["speed"],
        torque_nm=values["torque"],
        temperature_k=values["temperature"] + 273.15,
        remarks=remarks,
    )


def _title(name: str) -> str:
    return f"{name} [{UNITS[name]}]"


_Row = tuple[int, list[str]]


def _lines(path: Path | Traversable) -> tuple[tuple[str, ...], _Row, list[_Row]]:
    """Remarks, head and rows, the latter two with their line numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file") from error
    except UnicodeDecodeError as error:
        raise RecordError(f"{path}: not UTF-8 text ({error.reason} at byte {error.start}); export it as CSV") from error
    first = next((i for i, line in enumerate(text) if line.strip() and not line.startswith("#")), len(text))
    remarks = tuple(line.lstrip("# ").rstrip() for line in text[:first] if line.startswith("#"))
    try:
        filled = list(_filled(text[first:], first + 1))
    except csv.Error as error:
        raise RecordError(f"{path}: not CSV: {error}") from error
    if not filled:
        raise RecordError(f"{path}: empty; expected a head with {', '.join(map(_title, UNITS))}")
    return remarks, filled[0], filled[1:]


def _filled(text: list[str], start: int) -> Iterator[_Row]:
    for line, cells in enumerate(csv.reader(text, strict=True), start):
        if any(cell.strip() for cell in cells):
            yield line, cells


def _columns(file: str, line: int, head: list[str]) -> dict[str, int]:
    """Place of every quantity in the head."""
    places: dict[str, int] = {}
    for column, title in enumerate(head):
        name, _, unit = (part.strip() for part in title.strip().removesuffix("]").partition("["))
        name = name.lower()
        if name not in UNITS:
            continue
        if name in places:
            raise RecordError(f"{file}:{line}: column {name!r} stands twice; leave one")
        if unit != UNITS[name]:
            got = f"unit {unit!r}" if unit else "no unit"
            raise RecordError(
                f"{file}:{line}: column {name!r}: expected unit {UNITS[name]!r}, got {got}; "
                f"convert the values and write '{_title(name)}'"
            )
        places[name] = column
    missing = [f"'{_title(name)}'" for name in UNITS if name not in places]
    if missing:
        raise RecordError(f"{file}:{line}: missing column {', '.join(missing)}; the head is: {', '.join(head)}")
    return places


def _number(cell: str, name: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise RecordError(f"{where}: expected a number, got {cell.strip()!r}; repair or cut the line") from None
    if not np.isfinite(value):
        raise RecordError(f"{where}: expected a finite number, got {cell.strip()!r}; repair or cut the line")
    low, high = _RANGES.get(name, (-np.inf, np.inf))
    if not low <= value <= high:
        raise RecordError(f"{where}: expected {low:g} to {high:g} {UNITS[name]}, got {value:g}; is the unit right?")
    return value


def _check_time(file: str, time_s: Floats, lines: NDArray[np.int64]) -> None:
    steps = np.diff(time_s)
    if np.any(steps <= 0.0):
        at = int(np.argmax(steps <= 0.0))
        raise RecordError(
            f"{file}:{lines[at + 1]}: column '{_title('time')}': expected an increasing time, got {time_s[at + 1]:g} s "
            f"after {time_s[at]:g} s; sort the record or cut it where it starts again"
        )
    if np.any(steps > _LONGEST_GAP_S):
        at = int(np.argmax(steps > _LONGEST_GAP_S))
        raise RecordError(
            f"{file}:{lines[at + 1]}: column '{_title('time')}': gap of {steps[at]:.3g} s; the model needs the "
            f"pressure at least every {_LONGEST_GAP_S:g} s, so cut the record there"
        )
    span = float(time_s[-1] - time_s[0]) if time_s.size else 0.0
    if span < _SHORTEST_S or time_s.size < _FEWEST:
        raise RecordError(
            f"{file}: too short: {time_s.size} samples over {span:g} s; expected at least {_FEWEST} samples over "
            f"{_SHORTEST_S:g} s, because friction settles in some 10 s"
        )


def _check_excitation(file: str, values: dict[str, Floats]) -> None:
    stroke = float(np.ptp(values["pressure"]))
    if stroke < _LEAST_STROKE_BAR:
        raise RecordError(
            f"{file}: column '{_title('pressure')}': moves by {stroke:.3g} bar only; expected at least "
            f"{_LEAST_STROKE_BAR:g} bar, or a constant friction explains everything"
        )
    if float(np.mean(values["speed"])) < 0.05:
        raise RecordError(f"{file}: column '{_title('speed')}': the disc stands still; nothing can be identified")
    mean_nm = float(np.mean(values["torque"]))
    if mean_nm <= 0.0:
        raise RecordError(
            f"{file}: column '{_title('torque')}': the mean torque is {mean_nm:.3g} N m; a torque that brakes is "
            "positive, so turn the sign or look at the sensor"
        )

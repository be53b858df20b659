"""What to write instead: units that would fit, and names near to those that are wanted."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from hil.diagnosis.data.units import USUAL, units_of, written

if TYPE_CHECKING:
    from hil.diagnosis.data.log import Log

_SUFFIXES = ("_rad_s", "_mps2", "_mps", "_pa", "_nm", "_rad")
_WHEELS = ("fl", "fr", "rl", "rr")
_SHOWN = 20
"""Columns that a message lists, at most."""


def how_to_write(channel: str, unit: str) -> str:
    """How a file tells the unit of a channel."""
    return f'write `{channel} [{written(unit)}]` as the head of the column, or unit = "{written(unit)}" in the --map'


def unit_hint(channel: str, values: "np.typing.NDArray[np.float64]", low: float, high: float) -> str:
    """Units in which the values (n,) of a channel would lie between ``low`` and ``high``, and how to write them."""
    least, greatest = np.nanpercentile(values, (0.5, 99.5))
    fitting = [
        unit
        for unit, factor in units_of(channel).items()
        if factor != 1.0 and low <= factor * least and factor * greatest <= high
    ]
    fitting.sort(key=lambda unit: USUAL.get(channel.split("_")[0]) != unit)
    if not fitting:
        return "No unit that it may have makes it plausible: is it another quantity?"
    return f"If it is in {written(fitting[0])}, {how_to_write(channel, fitting[0])}"


def expected_instead(columns: Sequence[str], wanted: Iterable[str]) -> str:
    """The columns that were seen, those near to the names ``wanted``, and how to say which is which."""
    wanted = tuple(wanted)
    unknown_first = sorted(columns, key=lambda column: column in wanted or is_channel(column))
    shown = ", ".join(unknown_first[:_SHOWN]) + (f" and {len(columns) - _SHOWN} more" if len(columns) > _SHOWN else "")
    near = {name: column for name in wanted if (column := _nearest(name, columns)) is not None}
    parts = [f"columns seen: {shown or 'none'}"]
    if near:
        proposals = [f"{name} <- {column}" for name, column in list(near.items())[:6]]
        parts.append(f"near names: {', '.join(proposals)}")
    first, column = next(iter(near.items()), (wanted[0], columns[0] if columns else "COLUMN"))
    parts.append(
        f"name a column {', '.join(wanted[:6])}{' ...' if len(wanted) > 6 else ''}, or say which it is with "
        f'--map CHANNELS.toml: [{first}] signal = "{column}"'
    )
    return "; ".join(parts)


def is_channel(column: str) -> bool:
    """Whether a column has the name of a channel, which a reader need not look at."""
    return bool(units_of(column)) and column.endswith(_SUFFIXES)


def _nearest(name: str, columns: Sequence[str]) -> str | None:
    """The column whose name is near to ``name``, by its letters in lower case; None where none is."""
    lower: dict[str, str] = {}
    for column in columns:
        lower.setdefault(column.lower().replace(".", "_").replace(" ", "_"), column)
    stem = name
    for suffix in _SUFFIXES:
        stem = stem.removesuffix(suffix)
    found = get_close_matches(name, lower, 1, 0.7) or get_close_matches(stem, lower, 1, 0.7)
    return lower[found[0]] if found else None


def nothing_shows_speed(logs: "Sequence[Log]") -> str:
    """What to say where no log, or not every one, has a speed."""
    wanted = ("speed_mps", *(f"wheel_speed_{wheel}_rad_s" for wheel in _WHEELS))
    return (
        f"{_without(logs, wanted)}neither wheel speeds nor a speed in every log: nothing shows how the car moved; "
        + expected_instead(_columns(logs, wanted), wanted)
    )


def nothing_shows_force(logs: "Sequence[Log]") -> str:
    """What to say where no log, or not every one, has pressures or torques."""
    stems = (("pressure", "pa"), ("motor_torque", "nm"), ("pressure_demand", "pa"), ("motor_torque_demand", "nm"))
    wanted = tuple(f"{stem}_{wheel}_{unit}" for stem, unit in stems for wheel in _WHEELS)
    return (
        f"{_without(logs, wanted)}neither pressures nor motor torques of all wheels, measured or demanded: nothing "
        f"shows what braked the car; a speed alone serves where the car mostly coasts, for 10 s or more at a time; "
        f"{expected_instead(_columns(logs, wanted), wanted)}"
    )


def _lacking(logs: "Sequence[Log]", wanted: Iterable[str]) -> "list[Log]":
    return [log for log in logs if not any(name in log.channels for name in wanted)] or list(logs)


def _without(logs: "Sequence[Log]", wanted: Sequence[str]) -> str:
    lacking = _lacking(logs, wanted)
    more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
    return f"{lacking[0].name}{more}: "


def _columns(logs: "Sequence[Log]", wanted: Sequence[str]) -> tuple[str, ...]:
    return _lacking(logs, wanted)[0].columns

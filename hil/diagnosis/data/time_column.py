"""The time column of a table: its name, its unit, and stamps since 1970."""

from collections.abc import Mapping

import numpy as np

from hil.diagnosis.data.channel_map import to_si
from hil.diagnosis.data.columns import Column
from hil.diagnosis.data.hints import expected_instead
from hil.diagnosis.data.log import Floats, UnusableError

_NAMES = ("t_s", "time_s", "time", "t", "timestamp")
_BY_SUFFIX = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
NAMES = (*_NAMES, *(f"{stem}_{unit}" for unit in _BY_SUFFIX for stem in ("t", "time", "timestamp")))
"""Names of a time column, in the order in which they are looked for."""
_STEPS_S = (5e-4, 0.2)
"""Time between two samples that a log can have: 2 kHz to 5 Hz. In ms, us and ns these differ by their size."""
_SINCE_1970_S = (6e8, 4e9)
"""Stamps since 1970, s: the years 1989 to 2096."""


def times_s(name: str, columns: Mapping[str, Column], wanted: str | None) -> tuple[str, Floats, list[str]]:
    """The time column, its times from zero on, s, and remarks.

    Parameters
    ----------
    wanted : the column that a channel map names; None takes the first of `NAMES`.

    Raises
    ------
    UnusableError
        No time column; a unit that is none of time; a column `t_s` that can only be in another unit.
    """
    named = wanted if wanted is not None else next((key for key in NAMES if key in columns), None)
    if named is None or named not in columns:
        wish = (named,) if named is not None else ("t_s",)
        raise UnusableError(
            f"{name}: no time column {wish[0]}; columns seen: {', '.join(list(columns)[:20])}; name it t_s [s], or say "
            f'which it is with --map CHANNELS.toml: time = "{_likely(columns)}"'
            if columns
            else f"{name}: no column; {expected_instead((), wish)}"
        )
    column = columns[named]
    if not np.isfinite(column.values).any():
        raise UnusableError(f"{name}: {named} has no number; expected times in s, or whole numbers since 1970")
    suffix = named.rsplit("_", 1)[-1]
    if column.unit or suffix in _BY_SUFFIX:
        factor = to_si(column.unit, f"{name}: {named}")[0] if column.unit else _BY_SUFFIX[suffix]
        return named, _from_zero(column.values, factor), []
    factor, remarks = _by_its_steps(name, named, column.values)
    return named, _from_zero(column.values, factor), remarks


def _from_zero(values: Floats, factor: float) -> Floats:
    # the first stamp off before the factor: of stamps since 1970 in ns no digit is lost
    start = values[np.isfinite(values)][0]
    return np.asarray((values - start) * factor, np.float64)


def _by_its_steps(name: str, named: str, values: Floats) -> tuple[float, list[str]]:
    """Factor to seconds of a column without a unit, by the size of its numbers, and what to remark."""
    finite = values[np.isfinite(values)]
    steps = np.diff(finite)
    step, start = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0, float(finite[0])
    for unit, factor in _BY_SUFFIX.items():
        since_1970 = _SINCE_1970_S[0] < start * factor < _SINCE_1970_S[1]
        if not _STEPS_S[0] <= step * factor <= _STEPS_S[1] or step < 1.0:
            continue
        if named == "t_s" and not since_1970 and len(finite) > 2.0 / (step * factor):
            raise UnusableError(
                f"{name}: {named} steps by {step:g}, one sample every {step:g} s; in {unit} it would be "
                f"{1.0 / (step * factor):.4g} samples a second: write `{named} [{unit}]` as the head of the column, or "
                f"name it t_{unit}"
            )
        if named != "t_s" or since_1970:
            origin = " since 1970" if since_1970 else ""
            return factor, [f"{named} has no unit and steps by {step:g}: taken as {unit}{origin}"]
    return 1.0, []


def _likely(columns: Mapping[str, Column]) -> str:
    """The first column whose values only grow, as times do; else the first."""
    for key, column in columns.items():
        if len(column.values) > 1 and (np.diff(column.values) > 0.0).all():
            return key
    return next(iter(columns))

"""Every signal of a stranger's logs on one grid of 20 ms, and which of them can be no measured quantity."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbc.database import Database
from hil.diagnosis.data.channels_read import GAP_S
from hil.diagnosis.data.log import Floats, UnusableError
from hil.diagnosis.data.read import files_of, read_samples
from hil.diagnosis.data.trial.motion import STEP_S

_MOST_S = 1200.0
"""Time of a log that is looked at: a unit or a sign shows in a few minutes, or not at all."""
_BETWEEN_ROWS = 150
"""Empty rows between two logs: more than the longest lag looked for, so that no log is compared with another."""
_LEAST_SAMPLES = 50
_STATES = 3
"""Distinct values up to which a signal is a state or a flag."""
_JUMP, _EVEN, _CHECK, _COUNTER, _ONE_WAY = 0.5, 2.2, 0.1, 0.01, 0.8
"""A signal whose values are spread evenly and that moves by half of its range from one sample to the next is a check
value (every fourth time) or a counter (one of four bits once in sixteen, and nearly always down), or has their bits. A
brake that is on or off jumps as often up as down. Spread evenly is a kurtosis of 1.8; noise has 3."""


@dataclass(frozen=True, eq=False)
class Signal:
    """One signal or column.

    Attributes
    ----------
    values : (rows,) on the grid, NaN where there is none.  unit : as the file states it; empty where it does not.
    own_rate_hz : median rate of its samples.  unusable : why it is no measured quantity; empty where it may be one.
    """

    name: str
    unit: str
    values: Floats
    own_rate_hz: float
    unusable: str = ""


@dataclass(frozen=True, eq=False)
class Signals:
    """All signals of all logs, one log after the other; ``rows`` of 20 ms; ``time`` names the time column of tables.

    ``longest_s`` is the length of the longest log.
    """

    by_name: Mapping[str, Signal]
    rows: int
    files: tuple[str, ...]
    time: str | None
    longest_s: float

    @property
    def usable(self) -> dict[str, Signal]:
        """Signals that may be a measured quantity."""
        return {name: one for name, one in self.by_name.items() if not one.unusable}


def read_signals(paths: Sequence[Path], database: Database | None) -> Signals:
    """All signals of logs of one car.

    Raises
    ------
    UnusableError
        No log, or one without a signal; a CAN log without a database.
    """
    files = [read_samples(file, database) for path in paths for file in files_of(path)]
    if not files:
        raise UnusableError(f"no log in {', '.join(map(str, paths))}; give log files or a folder of them")
    spans = [_span(one.series) for one in files]
    counts = [max(int((end - begin) / STEP_S), 1) for begin, end in spans]
    rows = sum(counts) + _BETWEEN_ROWS * (len(counts) - 1)
    first = np.cumsum([0, *(count + _BETWEEN_ROWS for count in counts[:-1])])
    names = dict.fromkeys(name for one in files for name in one.series)
    by_name = {}
    for name in names:
        values, unit, rate = np.full(rows, np.nan), "", 0.0
        why = f"in none of {_LEAST_SAMPLES} samples or more"
        for one, (begin, _), at, count in zip(files, spans, first, counts, strict=True):
            if name not in one.series:
                continue
            t_s, own = _known(*one.series[name])
            unit = unit or one.units.get(name, "")
            if len(t_s) < _LEAST_SAMPLES:
                continue
            rate = float(1.0 / max(np.median(np.diff(t_s)), 1e-6))
            why = why if why == "" else _unusable(own)
            values[at : at + count] = _on_grid(t_s, own, begin + STEP_S * np.arange(count))
        by_name[name] = Signal(name, unit, values if why == "" else np.empty(0), rate, why)
    time = next((one.time for one in files if one.time), None)
    return Signals(by_name, rows, tuple(one.name for one in files), time, STEP_S * max(counts))


def _span(series: Mapping[str, tuple[Floats, Floats]]) -> tuple[float, float]:
    begins = [float(t[0]) for t, _ in series.values() if len(t)]
    ends = [float(t[-1]) for t, _ in series.values() if len(t)]
    if not begins:
        return 0.0, 0.0
    return min(begins), min(max(ends), min(begins) + _MOST_S)


def _known(t_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Samples with a value, at times that increase."""
    finite = np.isfinite(values) & np.isfinite(t_s)
    t_s, values = np.asarray(t_s[finite], np.float64), np.asarray(values[finite], np.float64)
    later = np.concatenate(([True], np.diff(t_s) > 0.0)) if len(t_s) else np.empty(0, bool)
    return t_s[later], values[later]


def _unusable(values: Floats) -> str:
    """Why a signal is no measured quantity."""
    span = float(np.ptp(values))
    if span == 0.0:
        return f"always {values[0]:g}"
    if len(np.unique(values[:20000])) <= _STATES:
        return "a state or a flag: three values at most"
    scaled = (values - values.mean()) / values.std()
    steps = np.diff(values)
    jumps = steps[np.abs(steps) > _JUMP * span]
    one_way = max(float(np.mean(jumps > 0.0)), float(np.mean(jumps < 0.0))) if len(jumps) else 0.0
    share = len(jumps) / len(steps)
    if float(np.mean(scaled**4)) < _EVEN and (share > _CHECK or (share > _COUNTER and one_way > _ONE_WAY)):
        return "jumps from sample to sample: a counter, a check value, or bits that belong to another signal"
    return ""


def _on_grid(t_s: Floats, values: Floats, grid_s: Floats) -> Floats:
    """Linear interpolation, NaN over gaps."""
    out = np.interp(grid_s, t_s, values, left=np.nan, right=np.nan)
    steps = np.diff(t_s)
    longest = max(GAP_S, 1.5 * float(np.median(steps)))
    if steps.max() > longest:
        out[steps[np.clip(np.searchsorted(t_s, grid_s) - 1, 0, len(steps) - 1)] > longest] = np.nan
    return out


def rejected(signals: Signals, names: Iterable[str]) -> dict[str, str]:
    """Why each of some signals is no measured quantity."""
    return {name: signals.by_name[name].unusable for name in names if signals.by_name[name].unusable}

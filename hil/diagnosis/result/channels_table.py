"""What was read, as a section of both reports: one row a channel over all logs; the JSON has every log's own."""

from collections.abc import Mapping, Sequence
from typing import Any

from hil.diagnosis.result.page_parts import rounded
from hil.report.report import Cell, Section, Table

_HEAD = ("channel", "read from", "Hz", "gaps", "empty, %", "range, SI", "late, ms")
_NOTE = (
    "Hz: rate of the samples as they came. Gaps: longer than 0.25 s. Late: behind the wheel speeds, where a log shows "
    "it; wheels slip, so that by 20 to 80 ms they lead the car."
)


def channels_section(content: Mapping[str, Any]) -> Section:
    """The section, of the answer's ``channels_read``."""
    groups: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in content["channels_read"]:
        groups.setdefault((row["channel"], row["column"], row["unit"]), []).append(row)
    rows = tuple(_row(*key, same) for key, same in groups.items())
    return Section("What was read", tables=(Table("Channels of all logs", _HEAD, rows, _NOTE),))


def _row(channel: str, column: str, unit: str, same: Sequence[Mapping[str, Any]]) -> tuple[Cell, ...]:
    late = [value for value in _values(same, "lag_s") if value != 0.0]
    return (
        channel,
        unit if column == channel else f"{column} [{unit}]",
        _span(_values(same, "rate_hz"), 1.0),
        sum(row["gaps"] for row in same),
        rounded(100.0 * max(row["nan_share"] for row in same)),
        _span([*_values(same, "least"), *_values(same, "greatest")], 1.0),
        _span(late, 1e3),
    )


def _values(same: Sequence[Mapping[str, Any]], key: str) -> list[float]:
    return [row[key] for row in same if row[key] is not None]


def _span(values: Sequence[float], factor: float) -> Cell:
    """One number, or the least and the greatest where they differ; None without any."""
    if not values:
        return None
    least, greatest = (f"{rounded(factor * value):g}" for value in (min(values), max(values)))
    return least if least == greatest else f"{least} to {greatest}"

"""The scores of blind trials as a report."""

from collections.abc import Mapping
from typing import Any

from hil.report.report import Cell, Number, Report, Section, Table, Verdict


def build_report(seed: int, families: Mapping[str, Mapping[str, Any]]) -> Report:
    """Put the table of all families into a report; the figure `confusion.png` lies beside it."""
    judged = [m["met"] for entry in families.values() for m in entry["metrics"].values() if m["met"] is not None]
    cases = sum(entry["n"] for entry in families.values())
    missed = sum(len(entry["missed"]) for entry in families.values())
    return Report(
        "Blind trials of explain",
        None if not judged else Verdict.PASSED if all(judged) else Verdict.FAILED,
        f"{sum(judged)} of {len(judged)} pass marks met" if judged else "no pass mark was asked for",
        (Number("Cases", cases), Number("Cases missed", missed)),
        tuple(_section(name, entry) for name, entry in families.items()),
        {"seed": seed},
    )


def _section(name: str, entry: Mapping[str, Any]) -> Section:
    rows: list[tuple[Cell, ...]] = [
        (metric.replace("_", " "), m["value"], m["low"], m["high"], m["pass_mark"], m["met"])
        for metric, m in entry["metrics"].items()
    ]
    tables = [Table("Scores", ("score", "value", "95 % from", "to", "pass mark", "met"), tuple(rows))]
    if limits := entry.get("detection_limits"):
        named = tuple((effect, "never named" if limit is None else f"{limit:g}") for effect, limit in limits.items())
        tables.append(Table("Detection limits", ("effect", "named from signal-to-noise"), named))
    if entry["missed"]:
        tables.append(Table("Missed", ("case",), tuple((case,) for case in entry["missed"])))
    sources = ", ".join(f"{state} {count}" for state, count in entry["sources"].items())
    several = f" of several states of the program: {sources}" if len(entry["sources"]) > 1 else ""
    return Section(name.replace("_", " "), tables=tuple(tables), text=f"{entry['n']} cases{several}.")

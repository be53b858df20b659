"""What `decode` and `diff` find, as pages."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hil.cli.origin import with_origin
from hil.cli.plot import gather
from hil.cli.progress import Progress
from hil.errors import BrakebenchError
from hil.log.atomic_write import atomic_write, check_folder
from hil.log.choice import Choice
from hil.log.compare.diff import LogDifference
from hil.log.compare.diff_signals import SignalDifference
from hil.log.several import Logs
from hil.log.signals.databases import Databases
from hil.report.html import render_html
from hil.report.report import Cell, Number, Panel, Report, Section, Table, Trace, Verdict

MOST_PANELS = 12
"""Signals of a comparison that are drawn: those that differ first, and of them those with a unit."""


def add_page(parser: argparse.ArgumentParser) -> None:
    """``--page``."""
    parser.add_argument("--page", metavar="FILE.html", type=Path, help="write what was found as a page")


def check_page(path: Path | None, overwrite: bool) -> None:
    """Refuse a page that cannot be written before a log is read."""
    if path is None:
        return
    if path.suffix.lower() != ".html":
        raise BrakebenchError(f"--page {path}: expected a name that ends in .html")
    check_folder(path)
    if path.exists() and not overwrite:
        raise BrakebenchError(f"{path}: exists already; remove it, or give another name")


def write_page(report: Report, path: Path, overwrite: bool, read: Sequence[Path]) -> None:
    """Write a report of logs; ``read`` are files that must not be written over."""
    with atomic_write(path, overwrite, read) as temporary:
        temporary.write_text(render_html(with_origin(report)), encoding="utf-8")


def decode_report(values: Mapping[str, Any], whole: bool) -> Report:
    """Put the values of `hil.cli.summary_json` into a report."""
    numbers = [Number(word.capitalize(), values[word]) for word in ("frames", "decoded", "unknown", "rejected")]
    first_ns = values["first_ns"] or 0
    channels = tuple(
        (name, c["frames"], c["errors"], c["duration_s"], _share(c["load"]), _share(c["worst_load"]), c["bit_rate"])
        for name, c in values["channels"].items()
    )
    ids = tuple((one["channel"], f"{one['id']:03X}", one["message"], one["count"], *_cycle(one["cycle"], first_ns))
                for one in values["ids"])  # fmt: skip
    signals = tuple(
        (name, s["unit"], s["count"], s["least"], s["greatest"], s["not_available"] or None, s["out_of_range"] or None)
        for name, s in values["signals"].items()
    )
    found: list[tuple[Cell, ...]] = [("note", note) for note in (*values["notes"], *values["dbc_warnings"])]
    found += [("rejected", f"{count:,}: {why}") for why, count in values["rejected_reasons"].items()]
    found += [("of no message", f"{name}: {count:,}") for name, count in values["unknown_ids"].items()]
    found += [("protection", f"{name}: {p['corrupt']} corrupt, {p['repeated']} repeated, {p['lost']} lost")
              for name, p in values["protection"].items() if p["corrupt"] or p["repeated"] or p["lost"]]  # fmt: skip
    heads = ("channel", "frames", "errors", "seconds", "load %", "worst second %", "bit/s")
    cycles = ("channel", "id", "message", "frames", "stated ms", "min", "p50", "p99", "max", "longest at s", "gaps")
    ranges = ("signal", "unit", "values", "least", "greatest", "not available", "out of range")
    sections = [
        Section("Channels", tables=(Table("", heads, channels),)),
        Section("Identifiers", tables=(Table("Cycle times in ms", cycles, ids),)),
        Section("Signals", tables=(Table("", ranges, signals),)),
        *([Section("Noticed", tables=(Table("", ("what", "which"), tuple(found)),))] if found else []),
    ]
    return Report(
        f"What {values['log']} holds", None if whole else Verdict.INCOMPLETE,
        f"{values['format']}; " + ("the whole log was read" if whole else "something was cut off, rejected or short"),
        (*numbers, Number("Duration", values["duration_s"], "s")), tuple(sections), {"logs": _paths(values)},
    )  # fmt: skip


def _paths(values: Mapping[str, Any]) -> list[str]:
    return [part["log"] for part in values["logs"]]


def _share(value: float | None) -> float | None:
    return None if value is None else round(100.0 * value, 1)


def _cycle(cycle: Mapping[str, Any] | None, first_ns: int) -> tuple[Cell, ...]:
    if cycle is None:
        return (None,) * 7
    times = (cycle[f"{name}_ms"] for name in ("stated", "min", "p50", "p99", "max"))
    return (*times, round((cycle["max_at_ns"] - first_ns) * 1e-9, 3), cycle["gaps"] or None)


def diff_report(
    found: LogDifference, names: tuple[str, str], courses: Mapping[str, tuple[Trace, Trace]], whole: bool
) -> Report:
    """Put a comparison into a report; ``courses`` are drawn."""
    different = differing(found)
    rows = tuple(
        (one.name, one.unit, one.compared, one.differing, one.only_first + one.only_second, one.first_s, one.greatest,
         one.greatest_s, one.rms)
        for one in different
    )  # fmt: skip
    heads = ("signal", "unit", "compared", "differ", "one-sided", "from s", "greatest", "at s", "rms")
    alone = tuple((m.name, m.first, m.second, m.unpaired_first, m.unpaired_second, m.unpaired_s)
                  for m in found.messages if not m.equal)  # fmt: skip
    only = [(name, count, 0) for name, count in found.only_first.items()]
    only += [(name, 0, count) for name, count in found.only_second.items()]
    only += [(f"{name} (of no message)", a, b) for name, (a, b) in found.unknown.items()]
    tables = [Table("Signals that differ, the first one first", heads, rows)] if rows else []
    if alone:
        columns = ("message", "in A", "in B", "only in A", "only in B", "from s")
        tables.append(Table("Frames without a partner", columns, alone))
    if only:
        tables.append(Table("In one log alone", ("message", "in A", "in B"), tuple(only)))
    units = {one.name: one.unit for one in different}
    panels = tuple(Panel(name, units[name], traces) for name, traces in courses.items())
    drawn = (
        f"{len(panels)} of {len(different)} signals that differ, those with a unit first."
        if len(panels) < len(different)
        else ""
    )
    clock = "by their stamps" if found.same_clock else "each from its first frame on"
    equal = "equal within the tolerances" if found.equal else "they differ"
    return Report(
        f"A {names[0]} and B {names[1]}", (Verdict.PASSED if found.equal else Verdict.FAILED) if whole
        else Verdict.INCOMPLETE, f"{equal}; compared {clock}",
        (Number("Signals compared", len(found.signals)), Number("of them differ", len(different))),
        (*([Section("Where they differ", panels, text=drawn)] if panels else ()),
         *([Section("Differences", tables=tuple(tables))] if tables else ())),
        {"A": names[0], "B": names[1]},
    )  # fmt: skip


def differing(found: LogDifference) -> list[SignalDifference]:
    """Signals that differ, the first one first."""
    return sorted((one for one in found.signals if not one.equal), key=lambda one: one.first_s or 0.0)


def diff_courses(
    found: LogDifference, first: Logs, second: Logs, of: Databases, choice: Choice, progress: Progress
) -> dict[str, tuple[Trace, Trace]]:
    """Read the signals that differ first, from both logs; times as the table has them."""
    names = [one.name for one in sorted(differing(found), key=lambda one: not one.unit)[:MOST_PANELS]]
    if not names:
        return {}
    chosen = Choice(choice.channels, signals=tuple(names))
    sides = [gather(logs, of.decoder(chosen.wanted(of)), chosen, progress) for logs in (first, second)]
    own = sides[0].first_ns
    starts = [own, own] if found.same_clock else [side.first_ns for side in sides]
    traces: dict[str, tuple[Trace, Trace]] = {}
    for name in names:
        pair = []
        for label, side, start in zip("AB", sides, starts, strict=True):
            times, y = side.signals[name].joined() if name in side.signals else (np.zeros(0, np.int64), np.zeros(0))
            pair.append(Trace(label, (times - start) / 1e9, y, "line" if label == "A" else "demand"))
        traces[name] = (pair[0], pair[1])
    return traces

"""``brakebench plot``: signals of a log over time, as a picture or a page."""

import argparse
from dataclasses import dataclass, field
from datetime import tzinfo
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dbc.database import Signal
from hil.cli.columns import say, terminal_width, wrapped
from hil.cli.log_options import (
    LOGS,
    add_databases,
    add_force,
    add_timezone,
    check_found,
    databases,
    paths,
    words_of,
)
from hil.cli.origin import origin
from hil.cli.progress import Progress
from hil.errors import BrakebenchError
from hil.log.atomic_write import atomic_write, check_folder
from hil.log.choice import Choice, Moment, matches
from hil.log.several import UNDATED_NS, Logs
from hil.log.signals.decode import Decoder
from hil.log.signals.decoded import Column, Values
from hil.log.source import ReadOptions
from hil.log.wall_clock import wall_clock_of
from hil.report.courses import Course, Courses
from hil.report.courses_page import courses_page
from hil.report.courses_picture import write_picture
from hil.report.pictures import can_draw, no_pictures
from hil.report.thin import thinned

SUFFIXES = (".html", ".png", ".svg", ".pdf")
MOST_SAMPLES = 2_000_000  # of all signals in memory; beyond, peaks are kept
LEAST_SAMPLES = 8  # of one signal and table
MOST_SIGNALS, MOST_TOGETHER, MOST_NAMES = 60, 8, 24
SILENCE = 10.0  # cycles without a frame leave a gap in the line


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "plot",
        description="Draw signals of a CAN log over one time axis; long logs are thinned, peaks stay.",
        epilog="Signals of one unit share a plot; signals whose values have names are drawn as steps with the names "
        "at the axis. Exit codes: 0 drawn, 1 drawn, but something of the log was cut off or rejected, 2 unusable.",
    )
    parser.add_argument("log", metavar="LOG", help=f"{LOGS}; a quoted pattern is one log")
    parser.add_argument("signal", metavar="SIGNAL", nargs="+", help="MESSAGE.SIGNAL or SIGNAL, with * and ?")
    parser.add_argument("--out", metavar="FILE", type=Path, required=True, help=f"file: {', '.join(SUFFIXES)}")
    add_databases(parser)
    add_force(parser)
    parser.add_argument("--channel", metavar="NAME", action="append", default=[], help="only this channel (repeatable)")
    parser.add_argument("--from", dest="begin", metavar="TIME", help="seconds from the first frame, or a date and time")
    parser.add_argument("--to", dest="end", metavar="TIME", help="likewise; both ends are included")
    add_timezone(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read the signals and draw them."""
    suffix = args.out.suffix.lower()
    if suffix not in SUFFIXES:
        got = f"the suffix {args.out.suffix!r}" if suffix else "no suffix"
        raise BrakebenchError(f"{args.out}: plots are written as {', '.join(SUFFIXES)}; got {got}")
    if suffix != ".html" and not can_draw():
        raise BrakebenchError(f"{args.out}: {no_pictures()}; .html needs nothing")
    check_folder(args.out)
    databases_, files = databases(args.dbc)
    begin, end = (None if text is None else Moment.parse(text, args.timezone) for text in (args.begin, args.end))
    choice = Choice(tuple(args.channel), begin, end, signals=words_of(args.signal))
    decoder = databases_.decoder(choice.wanted(databases_))
    with Logs(paths([args.log]), ReadOptions(timezone=args.timezone)) as logs, Progress() as progress:
        gathered = gather(logs, decoder, choice, progress)
        whole = logs.whole and not decoder.totals.rejected
        read = [*files, *(part.path for part in logs.parts)]
    if not gathered.signals:
        check_found(choice, gathered.frames, logs)
        hint = "" if args.dbc else "; give the database of this log with --dbc"
        raise BrakebenchError(f"{args.log}: no frame of {', '.join(args.signal)} in it{hint}")
    plots = panels(gathered, order_of(choice, list(gathered.signals)))
    samples = sum(signal.count for signal in gathered.signals.values())
    subtitle = _subtitle(gathered, samples, args.timezone)
    with atomic_write(args.out, args.force, read) as temporary:
        if suffix == ".html":
            temporary.write_text(courses_page(plots, Path(args.log).name, subtitle, origin()), encoding="utf-8")
        else:
            write_picture(plots, Path(args.log).name, subtitle, temporary)
    notes = [f"{args.out}: {len(gathered.signals)} signals, {samples:,} values"]
    if not whole:
        notes.append("something of the log was cut off, rejected or too short; brakebench decode tells what")
    say(line for note in notes for line in wrapped(note, terminal_width()))
    return 0 if whole else 1


@dataclass(slots=True)
class Gathered:
    """One signal being gathered.

    Attributes
    ----------
    count, held : values that came, and that are in memory.
    coarse : values that came for one in memory; alike for all of the log, so that its beginning looks as its end does.
    parts : stamps and values.
    """

    signal: Signal
    dtype: np.dtype[np.generic]
    count: int = 0
    held: int = 0
    coarse: float = 1.0
    parts: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]] = field(default_factory=list)

    def add(self, time_ns: npt.NDArray[np.int64], values: Values) -> None:
        """Add further values."""
        y = values.astype(np.float64)
        kept = thinned(y, max(LEAST_SAMPLES, int(len(y) / self.coarse)))
        self.parts.append((time_ns[kept], y[kept]))
        self.count += len(y)
        self.held += len(kept)

    def thin(self, most: int) -> None:
        """Keep half of ``most`` values where there are more."""
        if self.held > most:
            times, y = self.joined()
            kept = thinned(y, max(LEAST_SAMPLES, most // 2))
            self.parts = [(times[kept], y[kept])]
            self.coarse *= self.held / len(kept)
            self.held = len(kept)

    def joined(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Stamps, ascending, and values."""
        times = np.concatenate([part[0] for part in self.parts])
        values = np.concatenate([part[1] for part in self.parts])
        order = np.argsort(times, kind="stable")
        return times[order], values[order]


@dataclass(slots=True)
class Signals:
    """Signals by ``MESSAGE.SIGNAL``, the number of chosen frames, and the stamp of the log's first frame."""

    signals: dict[str, Gathered] = field(default_factory=dict)
    frames: int = 0
    first_ns: int = 0


def gather(logs: Logs, decoder: Decoder, choice: Choice, progress: Progress) -> Signals:
    """Read the chosen signals of a log."""
    found = Signals()
    for table in choice.frames(logs.tables(progress)):
        found.frames += len(table)
        for name, column in decoder.add(table).columns.items():
            if not len(column.rows):
                continue
            if name not in found.signals:
                if len(found.signals) >= MOST_SIGNALS:
                    raise BrakebenchError(
                        f"{' '.join(choice.signals)}: more than {MOST_SIGNALS} signals of the log; name fewer"
                    )
                found.signals[name] = Gathered(column.signal, column.values.dtype)
            found.signals[name].add(table.time_ns[column.rows], column.values)
        for one in found.signals.values():
            one.thin(MOST_SAMPLES // len(found.signals))
    found.first_ns = logs.first_ns
    return found


def order_of(choice: Choice, names: list[str]) -> list[str]:
    """Names in the order in which they were asked for."""
    ordered: dict[str, None] = {}
    for pattern in choice.signals:
        ordered |= dict.fromkeys(name for name in names if matches(*_parts(name), pattern))
    return list(ordered | dict.fromkeys(names))


def _parts(name: str) -> tuple[str, str]:
    message, _, signal = name.rpartition(".")
    return message, signal


def panels(gathered: Signals, names: list[str]) -> list[Courses]:
    """Signals of one unit together, signals with named values alone."""
    plots: list[Courses] = []
    open_plots: dict[str, int] = {}
    for name in names:
        one = gathered.signals[name]
        times, y = one.joined()
        t_s = (times - gathered.first_ns) / 1e9
        texts = _names(one, y)
        if texts is not None:
            values = np.array(list(texts))
            course = Course(name, t_s, np.searchsorted(values, y).astype(np.float64), steps=True)
            plots.append(Courses((course,), "", tuple(texts.values())))
            continue
        course = _with_gaps(Course(name, t_s, y))
        unit = one.signal.unit
        place = open_plots.get(unit) if unit else None
        if place is not None and len(plots[place].courses) < MOST_TOGETHER:
            plots[place] = Courses((*plots[place].courses, course), unit)
            continue
        open_plots[unit] = len(plots)
        plots.append(Courses((course,), unit))
    return plots


def _names(one: Gathered, y: npt.NDArray[np.float64]) -> dict[float, str] | None:
    """Texts of the values that occur (ascending), where most of them have a name, or are bits; None for a quantity."""
    values = np.unique(y[np.isfinite(y)])
    if one.signal.length == 1 and not one.signal.is_float:
        both = [raw * float(one.signal.factor) + float(one.signal.offset) for raw in (0, 1)]
        values = np.unique([*values, *both])
    elif len(values) > MOST_NAMES or 2 * len(_named(one, values)) < max(1, len(values)):
        return None
    named = _named(one, values)
    return {value: f"{named[value]}  {value:g}" if value in named else f"{value:g}" for value in values.tolist()}


def _named(one: Gathered, values: npt.NDArray[np.float64]) -> dict[float, str]:
    """Names of those values that have one."""
    if not one.signal.choices:
        return {}
    given: Any = values.astype(one.dtype)
    texts = Column(one.signal, np.arange(len(values)), given).names()
    return {value: text for value, text in zip(values.tolist(), texts.tolist(), strict=True) if text is not None}


def _with_gaps(course: Course) -> Course:
    """Leave the line out where a signal that comes cyclically is silent."""
    steps = np.diff(course.t_s)
    if len(steps) < 3:
        return course
    median = float(np.median(steps))
    cyclic = np.mean(np.abs(steps - median) <= 0.75 * median) >= 0.7
    silent = np.flatnonzero(steps > SILENCE * max(median, 0.01)) if cyclic else np.zeros(0, np.int64)
    t_s = np.insert(course.t_s, silent + 1, course.t_s[silent])
    return Course(course.name, t_s, np.insert(course.y, silent + 1, np.nan), course.steps)


def _subtitle(gathered: Signals, samples: int, zone: tzinfo) -> str:
    when = ""
    if gathered.first_ns >= UNDATED_NS:
        stamp = wall_clock_of(gathered.first_ns, zone).isoformat(" ", "milliseconds")
        when = f" · 0 s is {stamp} {zone}"
    return f"{len(gathered.signals)} signals, {samples:,} values{when}"

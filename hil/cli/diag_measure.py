"""``brakebench diag measure``: quantities of our ECU's law, at up to 100 Hz while it drives."""

import argparse
import csv
import difflib
import math
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.errors import BrakebenchError, Verdict

if TYPE_CHECKING:
    from hil.uds.own import Sample
    from hil.uds.tester import Tester

_RATES = {"slow": (1, 100), "medium": (2, 10), "fast": (3, 1)}  # transmission mode, ticks between two values
_TICKS = 256  # the tick number on the wire is one byte
_TICK_NS = 10_000_000


def add_measure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the action."""
    parser.add_argument("name", nargs="*", metavar="NAME", help="quantities, at most eight; left out: list them")
    parser.add_argument("--rate", choices=tuple(_RATES), default="fast", help="1, 10 or 100 Hz (default: fast)")
    parser.add_argument("--for", dest="for_s", type=float, default=1.0, metavar="S", help="how long (default: 1)")
    parser.add_argument("--out", metavar="FILE.csv", type=Path, help="write the values, a row per tick")
    parser.set_defaults(do=measure, action="measure")


def measure(tester: "Tester", args: argparse.Namespace) -> tuple[list[str], Any]:
    """Have the ECU send, count what came and what is missing by the law's tick number."""
    from ecu.diagnostics.protocol import MOST_PERIODIC
    from ecu.diagnostics.quantities import QUANTITIES
    from hil.uds.own import OWN, sample_of

    if tester.known is not OWN:
        raise BrakebenchError("measure: periodic data are known of our ECU only; leave --request-id out")
    units = {one.name: one.unit for one in QUANTITIES}
    if not args.name:
        return [f"{name:28} {unit}" for name, unit in units.items()], list(units)
    if not 0.0 < args.for_s <= 3600.0:
        raise BrakebenchError(f"--for {args.for_s:g}: expected seconds above 0, at most 3600")
    if args.out is not None and args.out.exists():
        raise BrakebenchError(f"{args.out}: exists already; give another name")
    numbers = {name: k for k, name in enumerate(units)}
    names = list(dict.fromkeys(args.name))
    if len(names) > MOST_PERIODIC:
        raise BrakebenchError(f"measure: {len(names)} quantities; the ECU sends at most {MOST_PERIODIC} at once")
    for name in names:
        if name not in numbers:
            close = difflib.get_close_matches(name, numbers, 3) or list(numbers)[:3]
            raise BrakebenchError(f"measure: no quantity {name!r}; there are {', '.join(close)}, ...")
    mode, step = _RATES[args.rate]
    taken = tester.measure(mode, bytes(numbers[name] for name in names), args.for_s)
    samples = [(time_ns, one) for time_ns, data in taken if (one := sample_of(data)) is not None]
    if not samples:
        raise _NothingError("measure: the ECU agreed, but no value came")
    if args.out is not None:
        _write(args.out, names, samples)
    lines, values = [], []
    for name in names:
        facts = _facts([(time_ns, one) for time_ns, one in samples if one.name == name], step)
        unit = "" if units[name] == "1" else f" {units[name]}"
        lines.append(
            f"{name:28} {facts['samples']:6} values, {facts['missing']} missing; "
            f"{facts['least']:.6g} to {facts['greatest']:.6g}{unit}, mean {facts['mean']:.6g}{unit}"
        )
        values.append({"name": name, "unit": units[name], **{k: _finite(v) for k, v in facts.items()}})
    return lines, values


class _NothingError(BrakebenchError):
    exit_code = Verdict.BROKEN.exit_code


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _facts(samples: list[tuple[int, "Sample"]], step: int) -> dict[str, float]:
    """How many values, how many ticks without one, and what they are (NaN where none is a number)."""
    missing = sum(max(0, (after - before) // step - 1) for before, after in pairwise(sorted(_by_tick(samples))))
    known = [one.value for _, one in samples if math.isfinite(one.value)] or [math.nan]
    return {
        "samples": len(samples),
        "missing": missing,
        "least": min(known),
        "greatest": max(known),
        "mean": sum(known) / len(known),
    }


def _by_tick(samples: list[tuple[int, "Sample"]]) -> list[int]:
    """Tick of each sample, counted from the first one's."""
    if not samples:
        return []
    first_ns, first_tick = samples[0][0], samples[0][1].tick
    ticks = []
    for time_ns, one in samples:
        # the byte tells the tick, the time of reception in which round of 256
        tick = (one.tick - first_tick) % _TICKS
        ticks.append(tick + round(((time_ns - first_ns) / _TICK_NS - tick) / _TICKS) * _TICKS)
    return ticks


def _write(path: Path, names: list[str], samples: list[tuple[int, "Sample"]]) -> None:
    """A row per tick of the law: its time since the first, s, counted in ticks, and the values that came with it."""
    from hil.log.atomic_write import atomic_write

    rows: dict[int, dict[str, float]] = {}
    for tick, (_, one) in zip(_by_tick(samples), samples, strict=True):
        rows.setdefault(tick, {})[one.name] = one.value
    with atomic_write(path, False, []) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *names])
        for tick, values in sorted(rows.items()):
            shown = [f"{values[name]:.9g}" if name in values else "" for name in names]
            writer.writerow([f"{tick * _TICK_NS * 1e-9:.2f}", *shown])

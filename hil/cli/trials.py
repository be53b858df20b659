"""``brakebench trials``: hide something, explain, open the answer, score."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hil.cli.options import add_json, add_seed, out_folder, positive
from hil.validation.blind_trials import FAMILIES


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "trials",
        description="Draws cases of a family from a car that shares no code with the plant, lets explain look at the "
        "logs alone, opens the sealed answer and scores it. Every finished case is appended to DIR/cases.jsonl; a "
        "second run goes on where the first one ended, and families may run side by side. DIR/table.json has scores "
        "and misses of all families with this seed, DIR/confusion.png what was named for what was hidden, "
        "DIR/report.html all of it as a page. A case takes "
        "half a minute to three.",
        epilog="families: null, nothing hidden; single, one effect at signal-to-noise 15, 8, 5 and 3; two and three at "
        "once; onset, one that begins in the middle; unlisted, a law in no list; confounded, straight stops that leave "
        "the cause open, then the manoeuvres that decide; twin, a sensor against its physical twin; not_testable, what "
        "the drive does not excite; parameters, gain and calibration score cases of single at 15 and 8 and run those "
        "alone that single has not run yet; strangers, cars of other equations by turns with nothing hidden, and "
        "strangers_single, with one cause at signal-to-noise 15; strangers_reference and strangers_reference_single, "
        "the same with reference logs of another day.",
    )
    parser.add_argument("--family", choices=FAMILIES, metavar="F", help="one of the families below (default: all)")
    parser.add_argument(
        "--count",
        type=positive,
        default=12,
        metavar="N",
        help="cases of a family; of single: at each signal-to-noise ratio, effects in turn (default: 12)",
    )
    add_seed(parser)
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument(
        "--own-error",
        type=Path,
        metavar="FILE",
        help="instead: measure the model's own error on N null cases into FILE",
    )
    instead.add_argument(
        "--apart",
        type=Path,
        metavar="FILE",
        help="instead: measure how far apart (d') the reference car holds all effects into FILE",
    )
    parser.add_argument(
        "--out",
        type=out_folder,
        default=Path("trials"),
        metavar="DIR",
        help="cases, table and figure (default: trials)",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the trials and print the table."""
    from hil.cli.origin import with_origin
    from hil.report.html import write_html
    from hil.validation.blind_trials.confusion import draw
    from hil.validation.blind_trials.page import build_report
    from hil.validation.blind_trials.run import run_family
    from hil.validation.blind_trials.score import table_of

    if args.own_error is not None:
        from hil.validation.blind_trials.discrepancy_table import as_toml, measure, tables

        return _measured(
            args.own_error, lambda: as_toml(tables(*measure(args.count, args.seed, _say)), args.count, args.seed)
        )
    if args.apart is not None:
        from hil.validation.blind_trials import separability

        return _measured(args.apart, lambda: separability.as_toml(separability.measure(args.seed, _say), args.seed))
    families = FAMILIES if args.family is None else (args.family,)
    scored: dict[str, Any] = {}
    singles: dict[tuple[int, float], Any] = {}
    for family in families:
        records = run_family(family, args.count, args.seed, args.out, _say)
        scored[family] = table_of(family, records)
        singles |= {(r["index"], r["size"]): r for r in records if r["family"] == "single"}
        _keep(args.out / "table.json", args.seed, scored)
    draw(list(singles.values()), args.out / "confusion.png")
    table = json.loads((args.out / "table.json").read_text(encoding="utf-8"))
    write_html(with_origin(build_report(args.seed, table["families"])), args.out / "report.html")
    if args.json:
        print(json.dumps({"seed": args.seed, "families": scored}, indent=2))
    else:
        for family, entry in scored.items():
            print("\n".join(_lines(family, entry)))
    return 0


def _measured(path: Path, text: Callable[[], str]) -> int:
    """Write what takes long to measure; a path that cannot be written is refused before."""
    from hil.log.atomic_write import atomic_write

    with atomic_write(path, overwrite=True) as part:
        part.touch()
        part.write_text(text(), encoding="utf-8")
    return 0


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def _keep(path: Path, seed: int, scored: dict[str, Any]) -> None:
    """Write the scores beside those of other families with the same seed."""
    before: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    others = before["families"] if before.get("seed") == seed else {}
    found = {**others, **scored}
    content = {"seed": seed, "families": {name: found[name] for name in FAMILIES if name in found}}
    path.write_text(json.dumps(content, indent=2), encoding="utf-8")


def _lines(family: str, entry: dict[str, Any]) -> list[str]:
    """The table of a family as text."""
    lines = [f"{family}: {entry['n']} cases"]
    if len(entry["sources"]) > 1:
        several = ", ".join(f"{state} {count}" for state, count in entry["sources"].items())
        lines.append(f"  of several states of the program: {several}")
    for name, m in entry["metrics"].items():
        if m["value"] is None:
            lines.append(f"  {name:<28}     -  no case tells")
            continue
        mark = "" if m["met"] is None else ("  met" if m["met"] else "  MISSED")
        passes = "" if m["pass_mark"] is None else f"  mark {m['pass_mark']}"
        lines.append(f"  {name:<28} {m['value']:.3f}  [{m['low']:.3f}, {m['high']:.3f}]{passes}{mark}")
    limits = entry.get("detection_limits", {})
    by_limit = {limit: [name for name, own in limits.items() if own == limit] for limit in set(limits.values())}
    for limit in sorted(by_limit, key=lambda value: float("inf") if value is None else value):
        words = "never named" if limit is None else f"named from {limit:g}"
        lines.append(f"  {words:<28} {', '.join(by_limit[limit])}")
    return lines + [f"  missed {case}" for case in entry["missed"]]

"""``brakebench trials``: hide something, explain, open the answer, score."""

import argparse
import json
import sys
from pathlib import Path

from hil.cli.options import add_json, add_seed

FAMILIES = ("null", "single", "parameters", "gain")


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "trials",
        help="blind trials of explain: hide, explain, open the answer, score",
        description="Draws cases of a family from a car that shares no code with the plant, lets explain look at the "
        "logs alone, opens the sealed answer and scores it. Every finished case is appended to DIR/cases.jsonl; a "
        "second run goes on where the first one ended.",
    )
    parser.add_argument("--family", choices=FAMILIES, help="one family (default: all)")
    parser.add_argument(
        "--count", type=int, default=12, metavar="N", help="cases a family, single: a size (default: 12)"
    )
    add_seed(parser)
    parser.add_argument(
        "--own-error",
        type=Path,
        metavar="FILE",
        help="instead: measure the model's own error on N null cases into FILE",
    )
    parser.add_argument("--out", type=Path, default=Path("trials"), metavar="DIR", help="where cases and table go")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the trials and print the table."""
    from hil.trials.run import run_family
    from hil.trials.score import table_of

    if args.own_error is not None:
        from hil.trials.own_error import as_toml, measure, ratios

        gains = measure(args.count, args.seed, lambda text: print(text, file=sys.stderr))
        args.own_error.write_text(as_toml(ratios(gains), args.count, args.seed), encoding="utf-8")
        return 0
    families = FAMILIES if args.family is None else (args.family,)
    result = {}
    for family in families:
        records = run_family(family, args.count, args.seed, args.out, lambda text: print(text, file=sys.stderr))
        result[family] = table_of(family, records)
    content = {"seed": args.seed, "families": result}
    (args.out / "table.json").write_text(json.dumps(content, indent=2), encoding="utf-8")
    if args.json:
        print(json.dumps(content, indent=2))
        return 0
    for family, entry in result.items():
        print(f"{family}: {entry['n']} cases")
        for name, m in entry["metrics"].items():
            mark = "" if m["met"] is None else ("  met" if m["met"] else "  MISSED")
            asked = "" if m["pass_mark"] is None else f"  asked {m['pass_mark']}"
            print(f"  {name:<28} {m['value']:.3f}  [{m['low']:.3f}, {m['high']:.3f}]{asked}{mark}")
    return 0

"""``brakebench reproduce``: the paper's numbers and figures, by its method and by ours."""

import argparse
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.options import add_json, out_folder
from hil.errors import BrakebenchError

if TYPE_CHECKING:
    from hil.validation.reproduce.study import Row


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "reproduce",
        description="Drive the paper's manoeuvres in virtual time with the paper's observer and with ours, under the "
        "nominal and nine other conditions, and print every number beside the paper's and its goal.",
        epilog="20 seeds are two hours of processor time; --keep lets it be stopped and gone on with. --json prints "
        "{rows: [{figure, claim, unit, paper, paper_method, median, p95, goal, statistic, met, conditions, seeds, "
        "degradation}]}.",
    )
    parser.add_argument("--out", type=out_folder, metavar="DIR", help="write the report and the figures")
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="seeds of the noise (default: 20)")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="keep what is measured, go on from what is there")
    parser.add_argument(
        "--extend",
        type=Path,
        metavar="FILE",
        help="extension that `explain` wrote: drive the paper's car with what it taught beside the nominal one, "
        "not the nine other conditions",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Drive, print, draw."""
    if args.seeds < 1:
        raise BrakebenchError(f"--seeds: expected at least 1, got {args.seeds}")
    from hil.cli.progress import Progress
    from hil.validation.reproduce.identification import identification_rows, shipped_study
    from hil.validation.reproduce.store import Store
    from hil.validation.reproduce.study import conditions_of, measure

    def say(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    conditions_of(args.extend)  # refuses a file that no car can have before anything is driven
    store = Store(args.keep, args.extend)
    say("identifying the pad friction (Figures 3 to 5) ...")
    rows = identification_rows(shipped_study())
    with Progress().part(0, "driving the cases") as progress:
        rows += measure(args.seeds, len(os.sched_getaffinity(0)), progress.tell, store, args.extend, progress)
    if args.out is not None:
        _write(args.out, rows)
    if args.json:
        print(json.dumps({"rows": [asdict(row) for row in rows]}, indent=2, allow_nan=False))
    else:
        from hil.validation.reproduce.summary import build_report, table_lines

        print("\n".join([*table_lines(rows), build_report(rows, {}).reason]))
    return 0


def _write(out: Path, rows: "list[Row]") -> None:
    from hil.cli.origin import with_origin
    from hil.report.figure import write_figure
    from hil.report.html import write_html
    from hil.report.pictures import no_pictures
    from hil.validation.reproduce.figures import figures
    from hil.validation.reproduce.summary import build_report

    try:
        out.mkdir(parents=True, exist_ok=True)
        drawn = figures()
        write_html(with_origin(build_report(rows, drawn)), out / "report.html")
        if not all(write_figure(figure, out / name) for name, figure in drawn.items()):
            print(no_pictures(), file=sys.stderr)
        (out / "result.json").write_text(
            json.dumps({"rows": [asdict(row) for row in rows]}, indent=2, allow_nan=False), encoding="utf-8"
        )
    except OSError as error:
        raise BrakebenchError(f"{out}: cannot be written ({error.strerror}); give another directory") from error
    print(f"report, figures and result.json written to {out}", file=sys.stderr)

"""``brakebench campaign``: thousands of runs in virtual time; stopped at any time, the same command goes on."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.cli.options import add_json, out_folder, positive

if TYPE_CHECKING:
    from hil.campaign.plan import Plan
    from hil.campaign.store import Store


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "campaign",
        description="Runs every point of CAMPAIGN.toml in virtual time on all processors, or on a Dask cluster, and "
        "keeps inputs, verdict and figures of every run in DIR/results (Parquet). Nothing is lost: stopped at any "
        "time, the same command goes on.",
        epilog="Exit codes: 0 all runs passed, 1 some failed, 3 some broke or killed their worker, 5 some are missing, "
        "2 wrong use. More: docs/campaigns.md.",
    )
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is run and varied")
    parser.add_argument("--out", type=out_folder, metavar="DIR", help="results and report (default: campaigns/NAME)")
    parser.add_argument("--workers", type=positive, metavar="N", help="processes (default: one a processor)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler in place of own processes")
    parser.add_argument("--repeat", type=int, metavar="RUN", help="instead: one run again, with recording and report")
    add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run what is missing, then report on all there is."""
    from hil.campaign.plan import load_plan
    from hil.campaign.report import build_report
    from hil.campaign.store import Store
    from hil.cli.origin import with_origin
    from hil.errors import INTERRUPTED_EXIT_CODE, Verdict
    from hil.report.html import write_html
    from hil.report.text import print_text
    from hil.rt.process import StopSignal

    plan = load_plan(args.campaign)
    if args.repeat is not None:
        return _repeat(plan, args.repeat, args.out)
    stop = StopSignal()
    store = Store(args.out or Path("campaigns") / args.campaign.stem, plan)
    with store.alone():
        rate = _run_missing(plan, store, args, stop)
        table = store.table()
        report = build_report(plan, table, rate)
        if not stop.asked:
            write_html(with_origin(report), store.folder / "report.html")
    if args.json:
        print(json.dumps(_values(report, store, rate), indent=2))
    else:
        print_text(report, sys.stdout, brief=True)
        print(f"\nresults  {store.folder / 'results'}")
        if not stop.asked:
            print(f"page     {store.folder / 'report.html'}")
    return INTERRUPTED_EXIT_CODE if stop.interrupted else (report.verdict or Verdict.PASSED).exit_code


def _run_missing(plan: "Plan", store: "Store", args: argparse.Namespace, stop: Any) -> float | None:
    """Runs a second; None where nothing was missing."""
    import os

    from hil.campaign.dask_workers import DaskWorkers
    from hil.campaign.engine import Killed, LocalWorkers, Workers, work
    from hil.campaign.tasks import killed
    from hil.cli.progress import Progress
    from hil.rt.clock import monotonic_ns

    missing = list(store.missing())
    if not missing:
        return None
    if len(missing) < plan.parts:
        print(f"{plan.parts - len(missing)} of {plan.parts} parts stand in {store.folder}; going on", file=sys.stderr)
    workers: Workers
    if args.scheduler is not None:
        workers = DaskWorkers(args.scheduler)
    else:
        workers = LocalWorkers(min(args.workers or os.cpu_count() or 1, len(missing)))
    began_ns, runs = monotonic_ns(), 0
    batches = (plan.part(number) for number in missing)
    with Progress().part(0, f"{plan.size} runs") as progress:
        for n, (batch, results) in enumerate(work(batches, plan.runner, workers, lambda: stop.asked), 1):
            done = [
                killed(run, result.times) if isinstance(result, Killed) else result
                for run, result in zip(batch, results, strict=True)
            ]
            store.add(batch[0].number // plan.part_size, done)
            runs += len(done)
            progress(n / len(missing))
    return runs / ((monotonic_ns() - began_ns) * 1e-9)


def _repeat(plan: "Plan", number: int, out: Path | None) -> int:
    """One run again, as ``brakebench run --virtual`` does."""
    from hil.bench.run import run_scenario
    from hil.errors import BrakebenchError

    if not 0 <= number < plan.size:
        raise BrakebenchError(f"--repeat {number}: {plan.source} has runs 0 to {plan.size - 1}")
    one = plan.run(number)
    outcome = run_scenario(
        plan.bases[one.scenario].scenario(dict(one.changes)), "auto", out=None if out is None else str(out),
        seed=one.seed, realtime=False, virtual=True, command_line=" ".join(sys.argv[1:]),
        say=lambda line: print(line, file=sys.stderr, flush=True),
    )  # fmt: skip
    outcome.print_text(sys.stdout)
    return outcome.exit_code


def _values(report: Any, store: "Store", rate: float | None) -> dict[str, Any]:
    return {
        "title": report.title,
        "verdict": report.verdict.value,
        "reason": report.reason,
        "runs": {number.label: number.value for number in report.numbers if number.label.startswith("Runs")},
        "rate_per_s": rate,
        "results": str(store.folder / "results"),
    }

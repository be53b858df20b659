"""One run from start to report: bench, measurement, expectations, files; in real or virtual time alike."""

import json
import math
import os
import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO

from dbc.contract import contract
from dbc.frame import BusName
from hil.bench.bench_run import BenchRun, BenchState
from hil.bench.real import RealBench
from hil.bench.result import RunResult, Signals, measure
from hil.bench.run_report import build_report
from hil.bench.virtual import VirtualBench
from hil.bus.timed.line import is_timed, open_line
from hil.log.export.tables import export
from hil.report.figure import write_figure
from hil.report.html import write_html
from hil.report.report import Number, Report, Verdict
from hil.report.text import print_text
from hil.rt.clock import wall_time_ns
from hil.rt.process import StopSignal
from hil.scenario.scenario import Scenario, load_scenario

EXIT_CODES = {Verdict.PASSED: 0, Verdict.FAILED: 1, Verdict.INCOMPLETE: 3}
EXPECTED = "Expected: "
INTERRUPTED_EXIT_CODE = 130  # 128 + SIGINT, as a shell reports it


@dataclass(frozen=True, slots=True)
class Outcome:
    """What ``brakebench run`` returns.

    Attributes
    ----------
    result : the numbers.
    report : everything, for any printer.
    facts : what ``--json`` adds to the numbers: bus, processes, log, verdict, ...
    exit_code : 0 ok, 1 an expectation failed, 3 the bench broke, 130 interrupted.
    """

    result: RunResult
    report: Report
    facts: dict[str, Any]
    exit_code: int

    def json_text(self) -> str:
        """One JSON object."""
        return json.dumps(self.result.as_json() | self.facts, indent=2)

    def print_text(self, stream: TextIO) -> None:
        """What a terminal can show, then where the files are."""
        print_text(self.report, stream, brief=True)
        stream.write("\n")
        for name in ("log", "signals", "figure", "page"):
            stream.write(f"{name:8} {self.facts[name]}\n")


def run_scenario(
    name: str,
    bus: str,
    *,
    out: str | None,
    seed: int,
    realtime: bool,
    command_line: str,
    say: Callable[[str], None],
    virtual: bool = False,
    without: Sequence[str] = (),
) -> Outcome:
    """Run one scenario in real or in virtual time and measure it.

    Raises
    ------
    BrakebenchError
        Before anything was started: no such scenario, a wrong field, a taken channel.
    """
    scenario = load_scenario(name)
    started_ns = wall_time_ns()
    folder = Path(out) if out else new_folder(scenario.name)
    stop = StopSignal()
    bench_run: BenchRun
    if virtual:
        bit_rate = contract(BusName.VEHICLE).bit_rate
        line = open_line(bus, bit_rate, seed) if is_timed(bus) else None
        bench_run = VirtualBench(scenario, folder, seed, say, stop, line=line)
    else:
        bench_run = RealBench(scenario, bus, folder, seed, realtime, say, stop, without)
    with bench_run:
        say(f"bus {bench_run.spec}" + (f" ({bench_run.note})" if bench_run.note else ""))
        bench_run.run()
    say("measuring")
    provenance = {"realtime asked for": realtime, "command line": command_line, "started": started_ns // 1_000_000_000}
    return finish(bench_run, seed, provenance)


def finish(bench_run: BenchRun, seed: int, provenance: Mapping[str, object], failure: str = "") -> Outcome:
    """Measure a run that has ended, judge it, and write its files.

    Parameters
    ----------
    provenance : what the caller knows of how it came about.
    failure : why a test on this bench failed; empty where the scenario's expectations decide.
    """
    scenario = bench_run.scenario
    signals = Signals(bench_run.log)
    result = measure(signals, bench_run.bit_rate)
    met = list(expected(scenario, result, signals))
    verdict, reason = _judge(bench_run, met, failure)
    report = build_report(
        scenario.title, signals, result, verdict, reason, _provenance(scenario, bench_run, seed) | dict(provenance)
    )
    report = replace(report, numbers=report.numbers + tuple(met))
    facts = {
        "scenario": scenario.name,
        "verdict": verdict.value,
        "reason": reason,
        "bus": bench_run.spec,
        "processes": bench_run.alive_at_end,
        "share_of_core": _shares(bench_run),
        "seed": seed,
    }
    facts |= _write(bench_run.out, report, signals)
    code = INTERRUPTED_EXIT_CODE if bench_run.state is BenchState.INTERRUPTED else EXIT_CODES[verdict]
    outcome = Outcome(result, report, facts, code)
    (bench_run.out / "result.json").write_text(outcome.json_text() + "\n")
    return outcome


def new_folder(name: str) -> Path:
    """A folder that does not exist yet: runs/NAME, runs/NAME-2, ..."""
    number = 1
    while True:
        folder = Path("runs") / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
            continue
        return folder


def expected(scenario: Scenario, result: RunResult, signals: Signals) -> Iterator[Number]:
    """What the scenario expects, and whether it came."""
    values = result.as_json()
    for e in scenario.expectations:
        value = values[e.name]
        met = value is not None and e.minimum <= value <= e.maximum
        yield Number(f"{EXPECTED}{e.name}", value, limit=f"{e.minimum:g} to {e.maximum:g}", met=met)
    for x in scenario.signal_expectations:
        t_s, samples = signals.get(x.signal)
        inside = samples[(t_s >= x.from_s - 1e-6) & (t_s <= x.to_s + 1e-6)]
        low, high = (float(inside.min()), float(inside.max())) if len(inside) else (math.nan, math.nan)
        met = x.minimum <= low and high <= x.maximum
        shown = f"{low:.6g} to {high:.6g}" if len(inside) else None
        yield Number(f"{EXPECTED}{x.name}", shown, limit=f"{x.minimum:g} to {x.maximum:g}", met=met)


def _judge(bench_run: BenchRun, expected: Sequence[Number], failure: str) -> tuple[Verdict, str]:
    if bench_run.state is BenchState.BROKEN:
        return Verdict.INCOMPLETE, bench_run.reason
    if bench_run.state is BenchState.INTERRUPTED:
        return Verdict.INCOMPLETE, "interrupted"
    if failure:
        return Verdict.FAILED, failure
    for number in expected:
        if not number.met:
            return Verdict.FAILED, f"{number.label.removeprefix(EXPECTED)}: expected {number.limit}, got {number.value}"
    return Verdict.PASSED, ""


def _provenance(scenario: Scenario, bench_run: BenchRun, seed: int) -> dict[str, object]:
    packages = ("brakebench", "numpy", "numba", "python-can", "cantools", "pyarrow")
    return {
        "scenario": {"name": scenario.name, "file": scenario.source, "sha256": scenario.sha256},
        "parameter sets": {"plant": scenario.plant_set, "ecu": scenario.ecu_set},
        "seed": seed,
        "bus": bench_run.spec,
        "processes": {
            child.name: child.error_path.read_text(errors="replace").strip() for child in bench_run.processes
        },
        "share of a core": _shares(bench_run),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
        "host": {"kernel": platform.release(), "machine": platform.machine(), "processors": os.cpu_count()},
        "executable": Path(sys.executable).name,
    }


def _shares(bench_run: BenchRun) -> dict[str, float]:
    """Processor time over time of each process, where it is known."""
    return {c.name: round(c.share_of_core, 4) for c in bench_run.processes if c.share_of_core is not None}


def _write(out: Path, report: Report, signals: Signals) -> dict[str, str]:
    """Write what people take away; paths open from the current folder."""
    files = {
        "log": out / "recording.log",
        "signals": out / "signals.parquet",
        "figure": out / "figure.png",
        "page": out / "report.html",
    }
    export(signals.decoded, files["signals"], overwrite=True)
    write_figure(report, files["figure"])
    write_html(report, files["page"])
    return {name: os.path.relpath(path) for name, path in files.items()}

"""One run from start to report: bench, measurement, expectations, files."""

import json
import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO

from hil.bench import Bench, BenchState
from hil.log.export import export
from hil.report.figure import write_figure
from hil.report.html import write_html
from hil.report.report import Number, Report, Verdict
from hil.report.text import print_text
from hil.result import RunResult, Signals, measure
from hil.rt.clock import wall_time_ns
from hil.run_report import build_report
from hil.scenario import Scenario, load_scenario

EXIT_CODES = {Verdict.PASSED: 0, Verdict.FAILED: 1, Verdict.INCOMPLETE: 3}
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
) -> Outcome:
    """Run one scenario in real time and measure it.

    Raises
    ------
    BrakebenchError
        Before anything was started: no such scenario, a wrong field, a taken channel.
    """
    scenario = load_scenario(name)
    started_ns = wall_time_ns()
    with Bench(name, bus, Path(out) if out else _folder(scenario), seed, realtime, say) as bench:
        say(f"bus {bench.spec}" + (f" ({bench.note})" if bench.note else ""))
        bench.run()
    say("measuring")
    signals = Signals(bench.log)
    result = measure(signals)
    verdict, reason = _judge(bench, result, scenario)
    provenance = _provenance(scenario, bench, seed, realtime, command_line, started_ns)
    report = build_report(scenario.title, signals, result, verdict, reason, provenance)
    report = _with_expectations(report, scenario, result)
    facts = {
        "scenario": scenario.name,
        "verdict": verdict.value,
        "reason": reason,
        "bus": bench.spec,
        "processes": bench.alive_at_end,
        "seed": seed,
    }
    facts |= _write(bench.out, report, signals)
    code = INTERRUPTED_EXIT_CODE if bench.state is BenchState.INTERRUPTED else EXIT_CODES[verdict]
    outcome = Outcome(result, report, facts, code)
    (bench.out / "result.json").write_text(outcome.json_text() + "\n")
    return outcome


def _folder(scenario: Scenario) -> Path:
    """A folder that does not exist yet: runs/NAME, runs/NAME-2, ..."""
    number = 1
    while True:
        folder = Path("runs") / (scenario.name if number == 1 else f"{scenario.name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
            continue
        return folder


def _judge(bench: Bench, result: RunResult, scenario: Scenario) -> tuple[Verdict, str]:
    if bench.state is BenchState.BROKEN:
        return Verdict.INCOMPLETE, bench.reason
    if bench.state is BenchState.INTERRUPTED:
        return Verdict.INCOMPLETE, "interrupted"
    values = result.as_json()
    for expectation in scenario.expectations:
        value = values[expectation.name]
        if value is None or not expectation.minimum <= value <= expectation.maximum:
            limits = f"{expectation.minimum:g} to {expectation.maximum:g}"
            return Verdict.FAILED, f"{expectation.name}: expected {limits}, got {value}"
    return Verdict.PASSED, ""


def _with_expectations(report: Report, scenario: Scenario, result: RunResult) -> Report:
    values = result.as_json()
    rows = tuple(
        Number(
            f"Expected: {e.name}",
            values[e.name],
            limit=f"{e.minimum:g} to {e.maximum:g}",
            met=values[e.name] is not None and e.minimum <= values[e.name] <= e.maximum,
        )
        for e in scenario.expectations
    )
    return Report(
        report.title, report.verdict, report.reason, report.numbers + rows, report.sections, report.provenance
    )


def _provenance(
    scenario: Scenario, bench: Bench, seed: int, realtime: bool, command_line: str, started_ns: int
) -> dict[str, object]:
    packages = ("brakebench", "numpy", "numba", "python-can", "cantools", "pyarrow")
    return {
        "scenario": {"name": scenario.name, "file": scenario.source, "sha256": scenario.sha256},
        "parameter sets": {"plant": scenario.plant_set, "ecu": scenario.ecu_set},
        "seed": seed,
        "bus": bench.spec,
        "realtime asked for": realtime,
        "command line": command_line,
        "started": started_ns // 1_000_000_000,
        "processes": {child.name: child.error_path.read_text(errors="replace").strip() for child in bench.processes},
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
        "host": {"kernel": platform.release(), "machine": platform.machine(), "processors": os.cpu_count()},
        "executable": Path(sys.executable).name,
    }


def _write(out: Path, report: Report, signals: Signals) -> dict[str, str]:
    """Write what people take away; paths open from the current folder."""
    files = {
        "log": out / "recording.log",
        "signals": out / "signals.parquet",
        "figure": out / "figure.png",
        "page": out / "report.html",
    }
    export(signals.decoded, files["signals"])
    write_figure(report, files["figure"])
    write_html(report, files["page"])
    return {name: os.path.relpath(path) for name, path in files.items()}

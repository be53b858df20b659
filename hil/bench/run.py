"""One run from start to report: bench, measurement, expectations, files; in real or virtual time alike."""

import contextlib
import json
import math
import os
import platform
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from dbc.contract import contract
from dbc.frame import BusName
from hil.bench.bench_run import BenchRun, BenchState, OutputError
from hil.bench.real import RealBench
from hil.bench.result import RunResult, Signals, measure
from hil.bench.run_report import build_report
from hil.bench.virtual import VirtualBench
from hil.bench.watch import MOST_MISSED, Finding
from hil.bus.timed.line import is_timed, open_line
from hil.errors import INTERRUPTED_EXIT_CODE, BrakebenchError, Verdict, in_words
from hil.log.export.blocks import block_of, layout_of
from hil.log.export.tables import export
from hil.log.frames import FrameTable, Recording
from hil.log.signals.decoded import DecodedLog
from hil.report.figure import write_figure
from hil.report.html import write_html
from hil.report.pictures import can_draw, no_pictures
from hil.report.report import Number, Report
from hil.report.text import print_text
from hil.rt.clock import wall_time_ns
from hil.rt.process import Child, StopSignal
from hil.scenario.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from hil.fmu.foreign_plant import OpenPlant

EXPECTED = "Expected: "
_UNITS = {"stop_distance_m": "m", "stop_time_s": "s", "mean_decel_mps2": "m/s²", "energy_recuperated_j": "J"}
"""Of what a scenario expects; counts have none."""
_FILES = {
    "log": "recording.log", "signals": "signals.parquet", "figure": "figure.png", "page": "report.html",
    "mcap": "recording.mcap",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Outcome:
    """What ``brakebench run`` returns.

    Attributes
    ----------
    result : the numbers.
    report : everything, for any printer.
    facts : what ``--json`` adds to the numbers: bus, processes, log, verdict, ...
    exit_code : of the verdict (`hil.errors.Verdict`); 130 where interrupted.
    """

    result: RunResult
    report: Report
    facts: dict[str, Any]
    exit_code: int

    @property
    def verdict(self) -> Verdict:
        """How the run is judged."""
        return Verdict(self.facts["verdict"])

    def json_text(self) -> str:
        """One JSON object."""
        return json.dumps(self.result.as_json() | self.facts, indent=2)

    def print_text(self, stream: TextIO) -> None:
        """What a terminal can show, then where the files are and what is missing."""
        print_text(self.report, stream, brief=True)
        stream.write("\n")
        if self.facts["real_time"] is not None:
            stream.write(f"on time  {self.facts['real_time']}\n")
        for name in _FILES:
            if self.facts.get(name) is not None:
                stream.write(f"{name:8} {self.facts[name]}\n")
        if not can_draw():
            stream.write(f"figure   {no_pictures()}\n")
        for line in self.facts["missing"]:
            stream.write(f"missing  {line}\n")


def run_scenario(
    name: str | Scenario,
    bus: str,
    *,
    out: str | None,
    seed: int,
    realtime: bool,
    command_line: str,
    say: Callable[[str], None],
    virtual: bool = False,
    without: Sequence[str] = (),
    transmit: bool = False,
    plant: "OpenPlant | None" = None,
    live: bool = False,
    terminal: bool = False,
    mcap: bool = False,
) -> Outcome:
    """Run one scenario in real or in virtual time and measure it.

    Parameters
    ----------
    name : of the library, a path, or a scenario that was read already (in virtual time alone: nodes read a file).
    plant : in virtual time, somebody else's FMU in the place of our car.
    live : in real time, serve a page that shows the run and commands it.
    terminal : in real time, draw the run on standard error.
    mcap : write the signals as MCAP beside the recording, too.

    Raises
    ------
    BrakebenchError
        Before anything was started: no such scenario, a wrong field, a taken channel, somebody else who sends what
        this run would send, a folder that cannot be written.
    """
    scenario = name if isinstance(name, Scenario) else load_scenario(name)
    started_ns = wall_time_ns()
    folder = Path(out) if out else new_folder(scenario.name)
    bench_run: BenchRun
    try:
        with _stop_signal() as stop:
            if virtual:
                bit_rate = contract(BusName.VEHICLE).bit_rate
                line = open_line(bus, bit_rate, seed) if is_timed(bus) else None
                node = None if plant is None else plant.node(scenario)
                bench_run = VirtualBench(scenario, folder, seed, say, stop, node, line=line)
            else:
                bench_run = RealBench(
                    scenario, bus, folder, seed, realtime, say, stop, without, transmit, live, terminal
                )
            with bench_run:
                say(f"bus {bench_run.spec}" + (f" ({bench_run.note})" if bench_run.note else ""))
                bench_run.run()
    except BrakebenchError:
        with contextlib.suppress(OSError):  # a folder in which nothing is
            folder.rmdir()
        raise
    if bench_run.error is not None:
        say(explained(bench_run))
    say("measuring")
    provenance = {"realtime asked for": realtime, "command line": command_line, "started": started_ns // 1_000_000_000}
    if plant is not None:
        provenance["plant"] = str(plant)
    return finish(bench_run, seed, provenance, mcap=mcap)


@contextlib.contextmanager
def _stop_signal() -> Iterator[StopSignal]:
    """Signals end the bench in order meanwhile, and do afterwards what they did before."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield StopSignal()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def explained(bench_run: BenchRun) -> str:
    """What broke a run, with the traceback of the code that did; empty where nothing did."""
    error = bench_run.error
    if error is None:
        return ""
    cause = error.__cause__
    if cause is None or isinstance(cause, (BrakebenchError, OSError)):
        return str(error)
    return "".join(traceback.format_exception(cause)).rstrip() + f"\n{error.reason}"


def finish(
    bench_run: BenchRun, seed: int, provenance: Mapping[str, object], failure: str = "", mcap: bool = False
) -> Outcome:
    """Measure a run that has ended, judge it, and write its files.

    There is a verdict whatever fails on the way: what could not be read or written is listed as missing.

    Parameters
    ----------
    provenance : what the caller knows of how it came about.
    failure : why a test on this bench failed; empty where the scenario's expectations decide.
    mcap : as of `run_scenario`.
    """
    scenario = bench_run.scenario
    missing: list[str] = []
    signals = _recorded(bench_run, missing)
    result = measure(signals, bench_run.bit_rate)
    met = list(expected(scenario, result, signals))
    findings = list(_judgements(bench_run, met, failure))
    verdict, reason = judge(findings)
    report = build_report(
        scenario.title, signals, result, verdict, reason, _provenance(scenario, bench_run, seed) | dict(provenance)
    )
    report = replace(report, numbers=report.numbers + tuple(met))
    paths = {name: bench_run.out / file for name, file in _FILES.items() if mcap or name != "mcap"}
    writers: dict[str, Callable[[Path], object]] = {
        "signals": lambda path: export(signals.decoded, path, overwrite=True),
        "figure": partial(write_figure, report),
        "page": partial(write_html, report),
    }
    if mcap:
        writers["mcap"] = partial(_write_mcap, signals.decoded)
    files = write_files(writers, paths, missing)
    facts = {
        "scenario": scenario.name,
        "verdict": verdict.value,
        "reason": reason,
        "findings": [{"verdict": finding.verdict.value, "text": finding.text} for finding in findings],
        "missing": missing,
        "unused_frames": signals.unused,
        "bus": bench_run.spec,
        "ended_early": bench_run.state in (BenchState.BROKEN, BenchState.UNRECORDED, BenchState.INTERRUPTED),
        "real_time": _real_time(bench_run, result),
        "processes": bench_run.alive_at_end,
        "share_of_core": _shares(bench_run),
        "seed": seed,
    }
    outcome = _outcome(bench_run, result, report, facts | files)
    try:
        (bench_run.out / "result.json").write_text(outcome.json_text() + "\n")
    except OSError as error:
        missing.append(f"result.json: {error.strerror}")
        outcome = _outcome(bench_run, result, report, facts | files)
    return outcome


def _write_mcap(decoded: DecodedLog, path: Path) -> None:
    """Write the signals of a recording for Foxglove, PlotJuggler and Rerun."""
    from hil.log.export.mcap_file import write_mcap

    write_mcap([block_of(decoded)], layout_of(decoded), path, overwrite=True)


def _outcome(bench_run: BenchRun, result: RunResult, report: Report, facts: dict[str, Any]) -> Outcome:
    """The outcome, incomplete at best where something is missing."""
    missing = facts["missing"]
    verdict, reason = Verdict(facts["verdict"]), facts["reason"]
    if missing and verdict.rank < Verdict.INCOMPLETE.rank:
        verdict, reason = Verdict.INCOMPLETE, f"missing: {'; '.join(missing)}"
    code = INTERRUPTED_EXIT_CODE if bench_run.state is BenchState.INTERRUPTED else verdict.exit_code
    report = replace(report, verdict=verdict, reason=reason)
    return Outcome(result, report, facts | {"verdict": verdict.value, "reason": reason, "exit_code": code}, code)


def _recorded(bench_run: BenchRun, missing: list[str]) -> Signals:
    """The signals on record; none where there is no recording."""
    try:
        return Signals(bench_run.log)
    except (OSError, BrakebenchError) as error:
        missing.append(f"{bench_run.log.name}: {in_words(error)}")
        return Signals(Recording(bench_run.log, "candump", FrameTable.empty()))


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
        except OSError as error:
            raise OutputError(f"{folder}: cannot be made ({error.strerror}); name a folder with --out") from error
        return folder


def expected(scenario: Scenario, result: RunResult, signals: Signals) -> Iterator[Number]:
    """What the scenario expects, and whether it came."""
    values = result.as_json()
    for e in scenario.expectations:
        value = values[e.name]
        met = value is not None and e.minimum <= value <= e.maximum
        yield Number(
            f"{EXPECTED}{e.name}", value, _UNITS.get(e.name, ""), limit=f"{e.minimum:g} to {e.maximum:g}", met=met
        )
    for x in scenario.signal_expectations:
        t_s, samples = signals.get(x.signal)
        inside = samples[(t_s >= x.from_s - 1e-6) & (t_s <= x.to_s + 1e-6)]
        low, high = (float(inside.min()), float(inside.max())) if len(inside) else (math.nan, math.nan)
        met = x.minimum <= low and high <= x.maximum
        shown = f"{low:.6g} to {high:.6g}" if len(inside) else None
        yield Number(f"{EXPECTED}{x.name}", shown, limit=f"{x.minimum:g} to {x.maximum:g}", met=met)


def missed(number: Number) -> str:
    """What was expected and what came instead, in a sentence."""
    got = f"{number.value:.6g}" if isinstance(number.value, float) else number.value
    return f"{number.label.removeprefix(EXPECTED)}: expected {number.limit}, got {got}"


def judge(findings: Sequence[Finding]) -> tuple[Verdict, str]:
    """The worst finding and how many there are beside it; *passed* where there is none."""
    if not findings:
        return Verdict.PASSED, ""
    worst = max(findings, key=lambda finding: finding.verdict.rank)
    more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
    return worst.verdict, worst.text + more


def _judgements(bench_run: BenchRun, expected: Sequence[Number], failure: str) -> Iterator[Finding]:
    """What the bench itself, a test, the expectations and the watch say."""
    if failure:
        yield Finding(Verdict.FAILED, failure)
    if bench_run.state is BenchState.BROKEN:
        yield Finding(Verdict.BROKEN, bench_run.reason)
    elif bench_run.state is BenchState.UNRECORDED:
        yield Finding(Verdict.INCOMPLETE, bench_run.reason)
    elif bench_run.state is BenchState.INTERRUPTED:
        yield Finding(Verdict.INCOMPLETE, "interrupted")
    else:
        for number in expected:
            if not number.met:
                yield Finding(Verdict.FAILED, missed(number))
        yield from bench_run.watch.findings()


def _provenance(scenario: Scenario, bench_run: BenchRun, seed: int) -> dict[str, object]:
    packages = ("brakebench", "numpy", "numba", "python-can", "cantools", "pyarrow")
    return {
        "scenario": {"name": scenario.name, "file": scenario.source, "sha256": scenario.sha256},
        "parameter sets": {"plant": scenario.plant_set, "ecu": scenario.ecu_set},
        "seed": seed,
        "bus": bench_run.spec,
        "processes": {child.name: _words_of(child) for child in bench_run.processes},
        "share of a core": _shares(bench_run),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in packages},
        "host": {"kernel": platform.release(), "machine": platform.machine(), "processors": os.cpu_count()},
        "executable": Path(sys.executable).name,
    }


def _real_time(bench_run: BenchRun, result: RunResult) -> str | None:
    """How punctual a run in real time was, for people; None in virtual time and where no node was started."""
    if not isinstance(bench_run, RealBench) or not bench_run.punctuality:
        return None
    skipped, ticks = bench_run.watch.skipped
    share = f"{skipped / ticks:.2%}" if ticks else "none heard"
    return (
        f"99 % of the ticks woke within {result.lateness_ms.p99:g} ms, the last within {result.lateness_ms.max:g} ms; "
        f"{skipped} of {ticks} skipped ({share}; beyond {MOST_MISSED:.0%} a run is inconclusive); "
        f"{bench_run.punctuality}"
    )


def _words_of(child: Child) -> str:
    try:
        return child.error_path.read_text(errors="replace").strip()
    except OSError as error:
        return f"unknown: {error.strerror}"


def _shares(bench_run: BenchRun) -> dict[str, float]:
    """Processor time over time of each process, where it is known."""
    return {c.name: round(c.share_of_core, 4) for c in bench_run.processes if c.share_of_core is not None}


def write_files(
    writers: Mapping[str, Callable[[Path], object]], paths: Mapping[str, Path], missing: list[str]
) -> dict[str, str | None]:
    """Write what people take away, each on its own; paths open from the current folder, None where there is no file.

    ``missing`` takes a line for each that could not be written.
    """
    for name, write in writers.items():
        try:
            write(paths[name])
        except Exception as error:  # whatever a library says of a full disk: the verdict must come out
            missing.append(f"{paths[name].name}: {error}")
            with contextlib.suppress(OSError):
                paths[name].unlink(missing_ok=True)  # half a file is none
    return {name: os.path.relpath(path) if path.exists() else None for name, path in paths.items()}

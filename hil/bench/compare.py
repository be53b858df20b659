"""One scenario in virtual and in real time: how far the two differ, and how old every message is when it is used."""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dbc.bench_messages import EcuReception, PlantReception
from dbc.contract import contract, spec_of
from dbc.e2e import COUNTER_MODULUS
from dbc.frame import BusName
from hil.bench.bench_run import RECORDING, prepare_folder
from hil.bench.result import Floats, Signals
from hil.bench.run import Outcome, judge, new_folder, run_scenario, write_files
from hil.bench.watch import Finding
from hil.bus.transmit import check_transmit
from hil.errors import Verdict
from hil.report.figure import write_figure
from hil.report.html import write_html
from hil.report.report import Number, Panel, Report, Section, Table, Trace
from hil.report.units import BAR, KMH, Unit
from hil.scenario.scenario import load_scenario

LAGS_S = np.arange(-60, 61) * 1e-3
_RECEPTIONS = (("ECU", EcuReception), ("PLANT", PlantReception))
_SHOWN: tuple[tuple[str, Unit, str, float], ...] = (
    ("Speed", KMH, "TRUTH_MOTION.SPEED", 1.0),
    ("Deceleration", "m/s²", "TRUTH_MOTION.ACCELERATION", -1.0),
    ("Pressure front left", BAR, "EHB_PRESSURE_FRONT.PRESSURE_FL", 1.0),
    ("Motor torque demand front left", "Nm", "MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL", 1.0),
    ("Estimated pad friction front left", "", "BRAKE_ESTIMATE_FRONT.PAD_FRICTION_FL", 1.0),
)


@dataclass(frozen=True, slots=True)
class SignalDifference:
    """How a signal of the real-time run differs from the virtual one over the manoeuvre, SI.

    Attributes
    ----------
    lsb : one step of the signal on the wire.
    max, rms : of real minus virtual at equal times of the manoeuvre.
    lag_ms : by how much the real signal comes later; None where it moves too little to tell.
    rms_aligned : what is left of ``rms`` once the lag is taken out.
    """

    signal: str
    lsb: float
    max: float
    rms: float
    lag_ms: float | None
    rms_aligned: float


@dataclass(frozen=True, slots=True)
class Ages:
    """Age of a message when it is first used, ms; None where it never was."""

    p50: float | None
    p99: float | None
    max: float | None


@dataclass(frozen=True, slots=True)
class Latency:
    """Age of one message at its receiver, from sending to the step that uses it."""

    message: str
    receiver: str
    virtual_ms: Ages
    real_ms: Ages


@dataclass(frozen=True, slots=True)
class Comparison:
    """What ``brakebench compare`` returns."""

    report: Report
    facts: dict[str, Any]
    exit_code: int

    def json_text(self) -> str:
        """One JSON object."""
        return json.dumps(self.facts, indent=2)


def compare_scenario(
    name: str,
    bus: str,
    *,
    out: str | None,
    seed: int,
    realtime: bool,
    command_line: str,
    say: Callable[[str], None],
    transmit: bool = False,
) -> Comparison:
    """Run a scenario twice, in virtual and in real time, and report the difference."""
    check_transmit(bus, transmit, "a run sends")
    scenario = load_scenario(name)
    folder = Path(out) if out else new_folder(f"{scenario.name}-compare")
    prepare_folder(folder)
    one = partial(run_scenario, name, seed=seed, command_line=command_line, say=say)
    virtual = one("auto", out=str(folder / "virtual"), realtime=False, virtual=True)
    if _ended_early(virtual):
        return _without_difference(virtual)
    real = one(bus, out=str(folder / "real"), realtime=realtime, transmit=transmit)
    if _ended_early(real):
        return _without_difference(real)
    logs = {"virtual": folder / "virtual" / RECORDING, "real": folder / "real" / RECORDING}
    signals = {kind: Signals(log) for kind, log in logs.items()}
    differences = signal_differences(signals["virtual"], signals["real"])
    latencies = message_latencies(signals["virtual"], signals["real"])
    runs = {"virtual": virtual, "real": real}
    findings = [
        Finding(run.verdict, f"{kind}: {run.facts['reason']}")
        for kind, run in runs.items()
        if run.verdict.rank > Verdict.FAILED.rank  # a comparison asks for the difference, not for the expectations
    ]
    verdict, reason = judge(findings)
    report = Report(
        f"Virtual against real time: {scenario.title}",
        verdict,
        reason,
        numbers=_numbers(virtual, real, latencies),
        sections=(_section(signals["virtual"], signals["real"], differences, latencies),),
        provenance={"virtual": dict(virtual.report.provenance), "real": dict(real.report.provenance)},
    )
    missing = [
        f"{kind}/{line}" for kind, run in (("virtual", virtual), ("real", real)) for line in run.facts["missing"]
    ]
    paths = {"figure": folder / "figure.png", "page": folder / "report.html"}
    written = write_files(
        {"figure": partial(write_figure, report), "page": partial(write_html, report)}, paths, missing
    )
    numbers = {key: (virtual.result.as_json()[key], real.result.as_json()[key]) for key in _NUMBERS}
    facts: dict[str, Any] = {
        key: {"virtual": v, "real": r, "difference": None if None in (v, r) else r - v}
        for key, (v, r) in numbers.items()
    }
    facts |= {
        "scenario": scenario.name,
        "verdict": verdict.value,
        "reason": reason,
        "missing": missing,
        "seed": seed,
        "bus": real.facts["bus"],
        "overruns": real.result.overruns,
        "frames_lost": real.result.frames_lost,
        "lateness_ms": asdict(real.result.lateness_ms),
        "signals": [asdict(d) for d in differences],
        "latency": [asdict(latency) for latency in latencies],
        "log_virtual": os.path.relpath(logs["virtual"]),
        "log_real": os.path.relpath(logs["real"]),
    }
    facts |= written
    try:
        (folder / "result.json").write_text(json.dumps(facts, indent=2) + "\n")
    except OSError as error:
        missing.append(f"result.json: {error.strerror}")
    if missing and verdict.rank < Verdict.INCOMPLETE.rank:
        verdict, reason = Verdict.INCOMPLETE, f"missing: {'; '.join(missing)}"
        facts |= {"verdict": verdict.value, "reason": reason}
    return Comparison(replace(report, verdict=verdict, reason=reason), facts, verdict.exit_code)


_NUMBERS = {
    "stop_distance_m": ("Δ stopping distance", "m"),
    "stop_time_s": ("Δ stopping time", "s"),
    "mean_decel_mps2": ("Δ deceleration", "m/s²"),
    "energy_recuperated_j": ("Δ energy", "J"),
}


def _ended_early(run: Outcome) -> bool:
    """Whether there is no whole recording to compare."""
    return run.facts["log"] is None or run.facts["ended_early"]


def _without_difference(run: Outcome) -> Comparison:
    return Comparison(run.report, run.result.as_json() | run.facts, run.exit_code)


def signal_differences(virtual: Signals, real: Signals) -> list[SignalDifference]:
    """Every signal that both runs hold, the health of the processes apart; names in the order of the DBC."""
    rows = []
    for bus in BusName:
        for spec in contract(bus).by_id.values():
            if spec.name.endswith(("_TIMING", "_RECEPTION")):
                continue
            for field in spec.fields:
                row = _difference(f"{spec.name}.{field.signal}", field.si_per_unit, field.enum is None, virtual, real)
                rows += [] if row is None else [row]
    return rows


def _difference(name: str, si: float, smooth: bool, virtual: Signals, real: Signals) -> SignalDifference | None:
    (t_v, v), (t_r, r) = virtual.get(name), real.get(name)
    if len(t_v) < 2 or len(t_r) < 2:
        return None
    lsb = abs(float(virtual.decoded.columns[name].signal.factor)) * si
    margin = float(LAGS_S[-1])
    inside = (t_v >= max(0.0, t_r[0] + margin)) & (t_v <= t_r[-1] - margin)
    t, v = t_v[inside], v[inside]
    if len(t) < 2:
        return None

    def at(times: Floats) -> Floats:
        if smooth:
            return np.interp(times, t_r, r)
        return np.asarray(r[np.clip(np.searchsorted(t_r, times, "right") - 1, 0, None)], np.float64)

    delta = at(t) - v
    rms = _rms(delta)
    lag, aligned = None, rms
    if smooth and float(np.std(v)) > 20.0 * lsb:
        errors = [_rms(at(t + shift) - v) for shift in LAGS_S]
        best = int(np.argmin(errors))
        if errors[best] < 0.9 * errors[len(LAGS_S) // 2] or best == len(LAGS_S) // 2:
            lag, aligned = float(LAGS_S[best]) * 1e3, errors[best]
    return SignalDifference(name, lsb, float(np.abs(delta).max()), rms, lag, aligned)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values)))


def message_latencies(virtual: Signals, real: Signals) -> list[Latency]:
    """Age of every message at its receiver, by the counters that the receivers report."""
    rows = []
    for receiver, kind in _RECEPTIONS:
        for field in spec_of(kind).fields:
            if not field.signal.startswith("COUNTER_"):
                continue
            message = field.signal.removeprefix("COUNTER_")
            rows.append(
                Latency(
                    message,
                    receiver,
                    ages_ms(virtual, message, f"{receiver}_RECEPTION.{field.signal}"),
                    ages_ms(real, message, f"{receiver}_RECEPTION.{field.signal}"),
                )
            )
    return rows


def ages_ms(signals: Signals, message: str, reported: str) -> Ages:
    """Age of a message's frames in the tick that first reports their counters."""
    t_used, used = _counters(signals, reported)
    t_sent, sent = _counters(signals, f"{message}.ALIVE_COUNTER")
    fresh = np.flatnonzero(np.diff(used, prepend=-1.0) != 0.0)
    t_used, used = t_used[fresh], used[fresh]
    last = np.searchsorted(t_sent, t_used, "right") - 1
    age = np.full(len(t_used), np.nan)
    for back in range(COUNTER_MODULUS - 1, -1, -1):  # the youngest frame of that counter decides
        row = last - back
        found = (row >= 0) & (sent[np.clip(row, 0, None)] == used) if len(sent) else np.zeros(len(used), bool)
        age[found] = t_used[found] - t_sent[row[found]]
    age = age[np.isfinite(age) & (t_used >= 0.0)] * 1e3
    if not len(age):
        return Ages(None, None, None)
    p50, p99, most = np.percentile(age, (50, 99, 100))
    return Ages(round(float(p50), 3), round(float(p99), 3), round(float(most), 3))


def _counters(signals: Signals, name: str) -> tuple[Floats, Floats]:
    """Times of the manoeuvre and raw values of a counter."""
    if name not in signals.decoded.columns:
        return np.empty(0), np.empty(0)
    t_s, values = signals.decoded.series(name)
    return t_s - signals.start_s, np.asarray(values, np.float64)


def _numbers(virtual: Outcome, real: Outcome, latencies: list[Latency]) -> tuple[Number, ...]:
    a, b = virtual.result.as_json(), real.result.as_json()
    rows = []
    for key, (label, unit) in _NUMBERS.items():
        shown = None if None in (a[key], b[key]) else b[key] - a[key]
        rows.append(Number(label, shown, unit, f"real {_text(b[key])} - virtual {_text(a[key])}"))
    slow = [row for row in latencies if row.real_ms.p99 is not None]
    worst = max(slow, key=lambda row: row.real_ms.p99 or 0.0, default=None)
    if worst is not None:
        rows.append(Number("Oldest message, p99", worst.real_ms.p99, "ms", f"{worst.message} at {worst.receiver}"))
    late = real.result.lateness_ms
    rows.append(Number("Lateness p99", late.p99, "ms", f"median {late.p50:.3f}, max {late.max:.3f}; real run"))
    rows.append(Number("Overruns", real.result.overruns, "", "ticks skipped in the real run"))
    return tuple(rows)


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"


def _section(virtual: Signals, real: Signals, differences: list[SignalDifference], latencies: list[Latency]) -> Section:
    panels = []
    for title, unit, name, sign in _SHOWN:
        traces = []
        for kind, signals in (("real", real), ("virtual", virtual)):
            t_s, values = signals.get(name)
            shown = t_s >= -0.5
            traces.append(Trace(kind, t_s[shown], sign * values[shown], "demand" if kind == "virtual" else "line"))
        panels.append(Panel(title, unit, tuple(traces)))
    t_s, values = virtual.get("TRUTH_MOTION.ACCELERATION")
    shown = t_s >= -0.5
    t_real, values_real = real.get("TRUTH_MOTION.ACCELERATION")
    if len(t_real):
        delta = np.interp(t_s[shown], t_real, values_real) - values[shown]
        panels.append(Panel("Deceleration, real - virtual", "m/s²", (Trace("difference", t_s[shown], -delta),)))
    ordered = sorted(differences, key=lambda d: -d.rms / d.lsb)
    signals_table = Table(
        "Signals: real minus virtual, largest first",
        ("signal (SI)", "max", "rms", "rms in LSB", "lag ms", "rms without lag"),
        tuple((d.signal, d.max, d.rms, d.rms / d.lsb, d.lag_ms, d.rms_aligned) for d in ordered),
        "Lag: shift that brings the real signal closest to the virtual one, where it moves enough to tell. Sensor "
        "noise is not the same in both: it depends on how many ticks the start was awaited.",
    )
    latency_table = Table(
        "Latency: age of a message in the step that uses it first, ms",
        ("message", "receiver", "virtual p50", "virtual max", "real p50", "real p99", "real max"),
        tuple(
            (x.message, x.receiver, x.virtual_ms.p50, x.virtual_ms.max, x.real_ms.p50, x.real_ms.p99, x.real_ms.max)
            for x in latencies
        ),
        "From the stamp of the message's frame to that of the receiver's report.",
    )
    return Section("Real against virtual time", panels=tuple(panels), tables=(latency_table, signals_table))

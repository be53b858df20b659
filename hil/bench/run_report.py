"""The report of one run, built from its recording."""

from collections.abc import Mapping
from enum import IntEnum

import numpy as np

from dbc.bench_messages import ManoeuvreState
from dbc.frame import BusName
from dbc.messages import BrakeMode, EhbState, Fault, MotorState
from hil.bench.result import Floats, RunResult, Signals, link_events
from hil.bench.watch import MOST_MISSED
from hil.bench.wire_timing import OWN_PAIRS, Spread, TimingError, cyclic_messages, response_of
from hil.log.signals.databases import Databases
from hil.report.report import Event, Lane, Number, Panel, Report, Section, Severity, Span, Style, Trace, Verdict
from hil.report.units import BAR, DEG_C, KJ, KMH, PERCENT

WHEELS = ("FL", "FR", "RL", "RR")
_AXLE = {"FL": "FRONT", "FR": "FRONT", "RL": "REAR", "RR": "REAR"}
FROM_S = -1.0  # nothing of the wait for the controller is shown but its last second
_BORNE = f"inconclusive beyond {100.0 * MOST_MISSED:g} % of a node's frames"
_MODE_SEVERITY: dict[int, Severity] = {0: "info", 1: "ok", 2: "warning", 3: "error", 4: "error"}


def build_report(
    title: str,
    signals: Signals,
    result: RunResult,
    verdict: Verdict,
    reason: str,
    provenance: Mapping[str, object],
) -> Report:
    """Put a run into a report: numbers, linked time series, timeline, and what was run."""
    section = Section("The stop", panels=_panels(signals), timeline=_timeline(signals))
    return Report(title, verdict, reason, (*_numbers(result), *_timing(signals)), (section,), provenance)


def _numbers(result: RunResult) -> tuple[Number, ...]:
    late = result.lateness_ms
    return (
        Number("Stopping distance", result.stop_distance_m, "m", "from the pedal's first movement to standstill"),
        Number("Stopping time", result.stop_time_s, "s"),
        Number("Mean deceleration", result.mean_decel_mps2, "m/s²"),
        Number("Mean fully developed deceleration", result.mfdd_mps2, "m/s²", "0.8 to 0.1 of the speed (UN R13-H)"),
        Number("Demanded deceleration", result.demanded_decel_mps2, "m/s²", "pedal map, mean over the stop"),
        Number("Energy recuperated", result.energy_recuperated_j, KJ),
        Number("Frames on the vehicle bus", result.frames_sent, ""),
        Number("Frames lost", result.frames_lost, "", _BORNE),
        Number("Frames corrupt", result.frames_corrupt, "", _BORNE),
        Number("Link events", ", ".join(f"{name} {count}" for name, count in result.link_states.items()) or "none"),
        Number("Bus load", result.bus_load, PERCENT, "with worst-case stuff bits"),
        Number("Overruns", result.overruns, "", "ticks skipped by ECU and plant"),
        Number("Lateness p50 / p99 / max", f"{late.p50:.3f} / {late.p99:.3f} / {late.max:.3f}", "ms", "worse node"),
    )


def _timing(signals: Signals) -> tuple[Number, ...]:
    """What `brakebench latency` says of the recording: through the controller, and the least regular message."""
    frames, databases = signals.decoded.recording.frames, Databases.own()
    if not len(frames):
        return ()
    numbers = []
    try:
        age = response_of(frames, databases, *OWN_PAIRS[0]).age
        numbers.append(Number("Wheel speed to demand p50 / p99 / max", _times(age), "ms", "age of the newest one"))
    except TimingError:  # one of them never came
        pass
    cyclic = [one for one in cyclic_messages(frames, databases) if one.stated and one.channel == BusName.VEHICLE]
    if cyclic:
        worst = max(cyclic, key=lambda one: one.jitter.p99_ms or 0.0)
        numbers.append(Number("Jitter p50 / p99 / max", _times(worst.jitter), "ms", f"of {worst.name}, the worst"))
    return tuple(numbers)


def _times(spread: Spread) -> str:
    return " / ".join("none" if one is None else f"{one:.3f}" for one in (spread.p50_ms, spread.p99_ms, spread.max_ms))


def _trace(
    signals: Signals, name: str, message: str, style: Style = "line", group: str = "", sign: float = 1.0
) -> Trace:
    t_s, values = signals.get(message)
    shown = t_s >= FROM_S
    return Trace(name, t_s[shown], sign * values[shown], style, group)


def _wheels(signals: Signals, pattern: str, name: str, style: Style = "line") -> tuple[Trace, ...]:
    """One trace a wheel; ``pattern`` holds {w} and {axle}."""
    return tuple(
        _trace(signals, f"{name} {w.lower()}", pattern.format(w=w, axle=_AXLE[w]), style, w.lower()) for w in WHEELS
    )


def _panels(signals: Signals) -> tuple[Panel, ...]:
    demanded = _trace(signals, "demanded", "BRAKE_STATUS.DEMANDED_DECELERATION", "demand")
    true = _trace(signals, "true", "TRUTH_MOTION.ACCELERATION", sign=-1.0)
    measured = _trace(signals, "accelerometer", "BODY_MOTION.LONGITUDINAL_ACCELERATION", "estimate", sign=-1.0)
    return (
        Panel("Speed", KMH, (_trace(signals, "vehicle", "TRUTH_MOTION.SPEED"),)),
        Panel("Wheel speed", "rad/s", _wheels(signals, "WHEEL_SPEED_{axle}.WHEEL_SPEED_{w}", "wheel")),
        Panel("Deceleration", "m/s²", (demanded, true, measured)),
        Panel(
            "Brake pressure",
            BAR,
            (
                _trace(signals, "demand front", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "demand"),
                _trace(signals, "demand rear", "EHB_DEMAND_REAR.PRESSURE_DEMAND_RL", "demand"),
                *_wheels(signals, "EHB_PRESSURE_{axle}.PRESSURE_{w}", "measured"),
            ),
        ),
        Panel("Motor torque demand", "Nm", _wheels(signals, "MOTOR_DEMAND_{axle}.TORQUE_DEMAND_{w}", "demand")),
        Panel(
            "Wheel torque",
            "Nm",
            (
                *_wheels(signals, "TRUTH_WHEEL_TORQUE.WHEEL_TORQUE_{w}", "true"),
                *_wheels(signals, "BRAKE_ESTIMATE_{axle}.WHEEL_TORQUE_{w}", "estimate", "estimate"),
            ),
        ),
        Panel(
            "Pad friction",
            "",
            (
                *_wheels(signals, "TRUTH_PAD_FRICTION.PAD_FRICTION_{w}", "true"),
                *_wheels(signals, "BRAKE_ESTIMATE_{axle}.PAD_FRICTION_{w}", "estimate", "estimate"),
            ),
        ),
        Panel("Disc temperature", DEG_C, _wheels(signals, "TRUTH_DISC_TEMPERATURE.DISC_TEMPERATURE_{w}", "disc")),
        Panel("Pedal travel", PERCENT, (_trace(signals, "channel 1", "BRAKE_PEDAL.PEDAL_TRAVEL_1"),)),
    )


def _spans(t_s: Floats, values: Floats) -> list[tuple[float, float, int]]:
    """Stretches of constant value: (start, end, value)."""
    t_s, values = t_s[t_s >= FROM_S], values[t_s >= FROM_S]
    if not len(t_s):
        return []
    edges = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    ends = np.append(t_s[edges[1:]], t_s[-1])
    return [(float(t_s[i]), float(end), int(values[i])) for i, end in zip(edges, ends, strict=True)]


def _timeline(signals: Signals) -> tuple[Lane, ...]:
    manoeuvre = [
        Span(a, b, _name(ManoeuvreState, v).lower()) for a, b, v in _spans(*signals.get("TRUTH_MOTION.MANOEUVRE"))
    ]
    modes = [
        Span(a, b, _name(BrakeMode, v), _MODE_SEVERITY.get(v, "error"))
        for a, b, v in _spans(*signals.get("BRAKE_STATUS.MODE"))
    ]
    faults = [
        Span(a, b, _fault_names(v), "error") for a, b, v in _spans(*signals.get("BRAKE_STATUS.ACTIVE_FAULTS")) if v
    ]
    brakes = [
        Span(a, b, f"{axle.lower()}: {_name(EhbState, v)}", "warning")
        for axle in ("FRONT", "REAR")
        for a, b, v in _spans(*signals.get(f"EHB_PRESSURE_{axle}.EHB_STATE_{axle}"))
        if v
    ]
    motors = [
        Span(a, b, f"{w.lower()}: {_name(MotorState, v)}", "error" if v == MotorState.FAILED else "warning")
        for w in WHEELS
        for a, b, v in _spans(*signals.get(f"MOTOR_STATUS_{_AXLE[w]}.FAULT_{w}"))
        if v
    ]
    events = [
        Event(e.time_ns * 1e-9, f"{e.bus}: {e.state} {e.detail}".strip(), "warning") for e in link_events(signals)
    ]
    return (
        Lane("Manoeuvre", tuple(manoeuvre)),
        Lane("ECU mode", tuple(modes)),
        Lane("ECU faults", tuple(faults)),
        Lane("Brake control", tuple(brakes)),
        Lane("Motors", tuple(motors)),
        Lane("Link", (), tuple(events)),
    )


def _name(kind: type[IntEnum], value: int) -> str:
    """Name of a value, which may be one that the DBC reserves."""
    return {one.value: one.name for one in kind}.get(value, f"RESERVED {value}")


def _fault_names(bits: int) -> str:
    """Names of the set bits, shortened where there are many (all of them before the first frames have come)."""
    names = [fault.name or "" for fault in Fault if fault and bits & fault]
    unknown = bits & ~sum(fault for fault in Fault if fault)
    names += [f"unknown bits 0x{unknown:X}"] if unknown else []
    return ", ".join(names if len(names) <= 3 else [*names[:2], f"{len(names) - 2} more"])

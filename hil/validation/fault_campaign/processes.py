"""Faults of real processes: killed, stopped, busy, late, recorder and disk; in real time on a loopback.

What is asserted is what happens; times are of the wall clock of a machine that does other things, too: they are shown.
"""

import tempfile
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dbc.messages import BrakeMode, EhbState
from hil.bench.bench_run import BenchState
from hil.bench.real import RealBench
from hil.bench.result import Signals
from hil.errors import BrakebenchError, in_words
from hil.faults.catalogue import fault_named
from hil.faults.fault import FROM_THE_FIRST_TICK
from hil.scenario.scenario import load_scenario
from hil.validation.fault_campaign.budgets import Miss
from hil.validation.fault_campaign.cases import SCENARIO, Armed, Case
from hil.validation.fault_campaign.job import twin
from hil.validation.fault_campaign.measure import NONE_NM, Measured
from hil.validation.fault_campaign.table import Row, row_of

Array = NDArray[np.float64]
AT_S = 3.0  # in the middle of braking
_LATE = FROM_THE_FIRST_TICK
CASES: tuple[tuple[str, str, float, float], ...] = (  # fault, target, at_s, for_s
    ("process_killed", "ECU", AT_S, 0.0),
    ("process_killed", "PLANT", AT_S, 0.0),
    *(("process_stopped", target, AT_S, for_s) for target in ("ECU", "PLANT") for for_s in (0.02, 0.05, 0.2)),
    ("process_busy", "ECU", AT_S, 0.05),
    ("process_busy", "PLANT", AT_S, 0.05),
    ("process_late", "ECU", _LATE, 0.5),
    ("process_late", "PLANT", _LATE, 0.5),
    ("recorder_killed", "RECORDER", AT_S, 0.0),
    ("disk_full", "RECORDER", AT_S, 0.0),
)
LOST_RECORDING_S = 0.1  # budget: frames that a killed recorder may take with it
MOST_IN_A_CYCLE = 3  # frames of one demand in 10 ms; more is a burst of late commands
_ENDS = {
    "process_killed": {BenchState.BROKEN},
    "recorder_killed": {BenchState.UNRECORDED},
    "disk_full": {BenchState.UNRECORDED},
}
_FALLS = 0.95  # of its torque: a motor that is not asked any more
_CYCLE_S, _GAP_S = 0.01, 0.015


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a recording tells of the time around a fault; s of the manoeuvre."""

    last_s: float  # last frame of the node befallen before it was silent
    back_s: float  # its next one; infinite where there is none
    reacted_s: float  # when the other side said so
    zero_s: float  # when it asked, or gave, no motor torque


def drive_processes(seed: int, progress: Callable[[float], None]) -> list[Row]:
    """Run every case once; a row each. ``progress`` takes the share that is done."""
    rows = []
    for n, (name, target, at_s, for_s) in enumerate(CASES):
        progress(n / len(CASES))
        armed = Armed(name, target, at_s, 1, {"for_s": for_s} if for_s else {})
        case = Case((name, f"{target} {1e3 * for_s:.0f} ms" if for_s else target), seed, (armed,))
        rows.append(row_of([(case, *_run(case))], fault_named(name).row))
    return rows


def _run(case: Case) -> tuple[Measured, list[Miss]]:
    (armed,) = case.faults
    scenario = replace(load_scenario(SCENARIO), faults=(armed.injection(),))
    with tempfile.TemporaryDirectory(prefix="brakebench-faults-") as folder:
        bench = RealBench(scenario, f"loopback:f{uuid.uuid4().hex[:10]}", Path(folder) / "run", case.seed)
        with bench:
            bench.run()
        m = Measured(befallen_s=armed.at_s)
        misses = [
            Miss("exceptions", 1.0, 0.0, text=f"{child.name} is left") for child in bench.processes if not child.ended
        ]
        if bench.state not in _ENDS.get(armed.name, {BenchState.FINISHED}):
            misses.append(Miss("exceptions", 1.0, 0.0, text=f"the run is {bench.state.value}: {bench.reason}"))
        try:
            signals = Signals(bench.log)
        except (OSError, BrakebenchError) as error:
            return m, [*misses, Miss("exceptions", 1.0, 0.0, text=f"the recording cannot be read: {in_words(error)}")]
        misses += _measure(m, signals, armed, case.seed, bench.state)
    return m, misses


def _measure(m: Measured, signals: Signals, armed: Armed, seed: int, state: BenchState) -> list[Miss]:
    distance = signals.get("TRUTH_MOTION.DISTANCE")[1]
    speed = signals.get("TRUTH_MOTION.SPEED")[1]
    if state is BenchState.FINISHED and len(speed) and speed[-1] < 0.1:
        beside = float(twin(seed, None).distance_m[-1])
        m.stop_ratio, m.longer_m = float(distance[-1]) / beside, float(distance[-1]) - beside
    _, mode = signals.get("BRAKE_STATUS.MODE")
    m.worst_mode = int(mode.max(initial=int(BrakeMode.NORMAL)))
    if armed.name in ("recorder_killed", "disk_full"):
        return _of_recorder(signals, armed)
    if armed.name == "process_late":
        return []
    seen = _around_ecu(signals) if armed.target == "ECU" else _around_plant(signals)
    if seen is None:
        return (
            [] if armed.values.get("for_s", 1.0) < 0.05 else [Miss("detect", np.inf, 0.0, text="no gap is on record")]
        )
    m.detect_ms, m.motor_zero_ms = 1e3 * (seen.reacted_s - seen.last_s), 1e3 * (seen.zero_s - seen.last_s)
    silent_s = seen.back_s - seen.last_s
    misses = []
    if silent_s > 0.06 and not np.isfinite(seen.reacted_s):
        misses.append(
            Miss("detect", np.inf, 0.0, text=f"{armed.target} was silent for {silent_s:.3f} s, nobody reacted")
        )
    if silent_s <= 0.06:  # shorter than the time-outs: nothing has to happen
        m.detect_ms, m.motor_zero_ms = np.nan, np.nan
    burst = _burst(signals, seen.back_s)
    if burst > MOST_IN_A_CYCLE:
        misses.append(
            Miss("stale_used", burst, MOST_IN_A_CYCLE, text=f"{burst} frames of one message in a cycle afterwards")
        )
    return misses


def _of_recorder(signals: Signals, armed: Armed) -> list[Miss]:
    times_s = signals.decoded.time_s - signals.start_s
    end_s = float(times_s[-1]) if len(times_s) else -np.inf
    if armed.name == "recorder_killed" and end_s < armed.at_s - LOST_RECORDING_S:
        return [
            Miss("exceptions", 1e3 * (armed.at_s - end_s), 1e3 * LOST_RECORDING_S, text="frames are lost on record")
        ]
    return []


def _around_ecu(signals: Signals) -> _Seen | None:
    times_s = signals.get("MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL")[0]
    gap = _gap(times_s, signals)
    if gap is None:
        return None
    own_s, own = signals.get("EHB_PRESSURE_FRONT.EHB_STATE_FRONT")
    current_s, current = signals.get("MOTOR_STATUS_FRONT.CURRENT_FL")
    before = np.abs(current[current_s <= gap[0]][-1:]).max(initial=0.0)
    ends_s = _first(current_s, np.abs(current) < _FALLS * before, gap[0])  # the motor's own ramp is not the demand's
    return _Seen(*gap, _first(own_s, own == EhbState.OWN_PEDAL_MAP, gap[0]), ends_s)


def _around_plant(signals: Signals) -> _Seen | None:
    gap = _gap(signals.get("BRAKE_PEDAL.PEDAL_TRAVEL_1")[0], signals)
    if gap is None:
        return None
    mode_s, mode = signals.get("BRAKE_STATUS.MODE")
    asked_s, asked = signals.get("MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL")
    return _Seen(
        *gap, _first(mode_s, mode > BrakeMode.NORMAL, gap[0]), _first(asked_s, np.abs(asked) < NONE_NM, gap[0])
    )


def _gap(times_s: Array, signals: Signals) -> tuple[float, float] | None:
    """Longest silence from the fault on: last frame before, first frame behind (infinite: none)."""
    times_s = times_s[times_s > AT_S - 2.0 * _CYCLE_S]
    if not len(times_s):
        return None
    end_s = float(signals.decoded.time_s[-1]) - signals.start_s
    if end_s - times_s[-1] > 5.0 * _GAP_S:
        return float(times_s[-1]), np.inf
    steps = np.diff(times_s)
    if not len(steps) or steps.max() < _GAP_S:
        return None
    k = int(steps.argmax())
    return float(times_s[k]), float(times_s[k + 1])


def _first(times_s: Array, holds: NDArray[np.bool_], from_s: float) -> float:
    at = np.flatnonzero(holds & (times_s >= from_s))
    return float(times_s[at[0]]) if len(at) else np.inf


def _burst(signals: Signals, from_s: float) -> int:
    """Most frames of one demand within a cycle, from a time on."""
    most = 0
    for name in ("MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL"):
        times_s = signals.get(name)[0]
        times_s = times_s[(times_s >= from_s) & (times_s < from_s + 1.0)]
        within = np.searchsorted(times_s, times_s + 0.9 * _CYCLE_S) - np.arange(len(times_s))
        most = max(most, int(within.max(initial=0)))
    return most

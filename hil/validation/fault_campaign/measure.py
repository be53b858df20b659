"""What a fault did to a stop: the trace beside that of its twin without the fault."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dbc.messages import BrakeMode, Fault
from hil.faults.fault import Expected, Injection, Side
from hil.validation.fault_campaign.drive import STANDING_MPS, TICK_S, Trace

Array = NDArray[np.float64]
NONE_NM = 10.0  # motor torque that counts as none: 0.02 m/s2 of the car
LITTLE_NM = 100.0  # regeneration below which its loss is not looked at: 0.2 m/s2
SHORTFALL_MPS2 = 1.0  # budget: deceleration below the demand
TAKEN = 0.9  # budget: share of the lost regeneration that friction gives
HALF = 0.5  # a brake that gives less than half of what is due has let go
MISSING = {"motor_deaf": 40.0, "motor_weak": 110.0}
"""Torque asked of a motor below which a missing part is not seen: inside the 20 % and 30 Nm of a motor that is well."""
_HANDOVER_S = 1.0  # friction takes over within, or never
_MOTOR_SOURCES = {"MOTOR_STATUS_FRONT": (0, 1), "MOTOR_STATUS_REAR": (2, 3), "MOTOR_DEMAND_FRONT": (0, 1),
                  "MOTOR_DEMAND_REAR": (2, 3), "IWM": (0, 1, 2, 3), "ECU": (0, 1, 2, 3), "PLANT": (0, 1, 2, 3)}  # fmt: skip
FROM_THE_CONTROLLER = ("EHB_DEMAND_FRONT", "EHB_DEMAND_REAR", "MOTOR_DEMAND_FRONT", "MOTOR_DEMAND_REAR", "ECU")


@dataclass(slots=True)
class Measured:
    """One run beside its twin; NaN where there is nothing to measure.

    Attributes
    ----------
    detect_ms : first frame befallen (or switch in the car) to the controller's report.
    motor_zero_ms : to no torque demand for what has failed.
    friction_back_ms : report to friction giving 90 % of the lost regeneration.
    dip_mps2, dip_ms : deepest shortfall of deceleration, and how long it was above 1.0 m/s2.
    lost_nm, lost_mps2 : regeneration that was lost, at its most.
    release_ms : how long the brakes gave less than half of what the driver asked for.
    stop_ratio, longer_m : distance over the twin's, and the difference.
    recovery_ms : end of the fault to the twin's mode.
    worst_mode : while it acted.
    left_s : from the first frame befallen to the stop.
    stale_used, altered : frames.
    error : what was raised.
    wrong_faults, wrong_modes : what was reported beside what is right.
    """

    detect_ms: float = math.nan
    motor_zero_ms: float = math.nan
    friction_back_ms: float = math.nan
    dip_mps2: float = math.nan
    dip_ms: float = math.nan
    lost_nm: float = math.nan
    lost_mps2: float = math.nan
    release_ms: float = math.nan
    stop_ratio: float = math.nan
    longer_m: float = math.nan
    recovery_ms: float = math.nan
    worst_mode: int = int(BrakeMode.NORMAL)
    befallen_s: float = math.nan
    left_s: float = math.nan
    stale_used: int = 0
    altered: int = 0
    error: str = ""
    wrong_faults: Fault = Fault.NONE
    wrong_modes: tuple[str, ...] = ()
    codes: tuple[str, ...] = ()
    healing: tuple[str, ...] = field(default_factory=tuple)


def measure(trace: Trace, twin: Trace, fault: Injection) -> Measured:
    """Measure the run of one fault."""
    name, right = fault.kind.name, fault.expected
    wheels = wheels_of(fault)
    if name in MISSING and not math.isnan(trace.befallen_s):  # nothing is missing of what is not asked for
        asked = twin.motor_nm[:, list(wheels)].max(axis=1)
        due = np.flatnonzero(asked[int(trace.befallen_s / TICK_S + 1e-6) :] > MISSING[name])
        trace.befallen_s = trace.befallen_s + int(due[0]) * TICK_S if len(due) else math.nan
    m = measured(trace, twin, right, fault.until_s, wheels, _of_controller(fault))
    if right.motor_zero_ms is None:
        m.motor_zero_ms = math.nan
    if without_car(fault):
        forget_brakes(m)
    return m


def without_car(fault: Injection) -> bool:
    """Whether the process of the car stands still: a brake's figures say nothing then."""
    return fault.kind.family == "process" and fault.target.name == "PLANT"


def forget_brakes(m: Measured) -> None:
    """Take out what a car that is not stepped cannot show."""
    m.dip_mps2 = m.dip_ms = m.release_ms = m.lost_nm = m.lost_mps2 = m.friction_back_ms = math.nan


def wheels_of(fault: Injection) -> tuple[int, ...]:
    """Motors that a fault takes away; none where it does not."""
    if fault.kind.name.startswith("motor_"):
        return tuple(i for i in range(4) if fault.target.wheels >> i & 1)
    return _MOTOR_SOURCES.get(fault.target.name.partition(".")[0], ())


def _of_controller(fault: Injection) -> bool:
    return fault.target.name in FROM_THE_CONTROLLER and fault.kind.side is not Side.PLANT


def measured(
    trace: Trace, twin: Trace, right: Expected, until_s: float, wheels: tuple[int, ...], from_controller: bool
) -> Measured:
    """Measure a run.

    Parameters
    ----------
    right : what the controller may do.
    until_s : end of the fault.
    wheels : whose motors it takes away.
    from_controller : whether it befell what the controller sends: then what the motors follow counts, not the wire.
    """
    m = Measured(altered=trace.altered, error=trace.error, befallen_s=trace.befallen_s)
    n = len(trace.speed_mps)
    if not n or math.isnan(trace.speed_mps[0]):
        return m
    other = _Rows(twin, n)
    m.longer_m = float(trace.distance_m[-1] - other.distance_m[-1])
    m.stop_ratio = float(trace.distance_m[-1] / other.distance_m[-1]) if trace.speed_mps[-1] <= 0.1 else math.nan
    _look_at_reports(m, trace, other, right, until_s)
    if math.isnan(trace.befallen_s):
        return m
    first = min(int(trace.befallen_s / TICK_S + 1e-6), n - 1)
    stopped = np.flatnonzero(trace.speed_mps[first:] <= STANDING_MPS)
    m.left_s = (stopped[0] if len(stopped) else n - first) * TICK_S
    worse = trace.mode > np.maximum(other.mode, int(BrakeMode.NORMAL))
    own = trace.faults & ~np.maximum(other.faults, 0)
    told = (own & int(right.trouble)) != 0
    found = np.flatnonzero((trace.mode[first:] >= 0) & (told | worse)[first:])
    seen = first + int(found[0]) if len(found) else None
    if seen is not None:  # rows are the car's ticks; the controller's are half a tick later
        m.detect_ms = 1e3 * ((seen + 0.5) * TICK_S - trace.befallen_s)
    own_map = np.flatnonzero(trace.own_map[first:])
    if len(own_map) and (trace.mode[first + int(own_map[0])] < 0 or seen is None):  # the brake itself finds it
        seen = min(first + int(own_map[0]), n if seen is None else seen)
        m.detect_ms = 1e3 * (seen * TICK_S - trace.befallen_s)
    m.stale_used = sum(seen is None or at_s < seen * TICK_S for at_s in trace.stale_s)
    _look_at_motors(m, trace, other, first, seen, wheels, from_controller)
    _look_at_brakes(m, trace, other, first, until_s)
    if math.isfinite(until_s) and seen is not None:
        end = int(round(until_s / TICK_S))
        begun, said = max(first, end - 5), np.flatnonzero(trace.mode >= 0)
        if worse[begun:].any():
            last = begun + int(np.flatnonzero(worse[begun:])[-1])
            m.recovery_ms = math.inf if last >= said[-1] else max(0.0, 1e3 * TICK_S * (last + 1 - end))
    return m


class _Rows:
    """The twin's columns, its last row repeated to a length."""

    def __init__(self, twin: Trace, n: int) -> None:
        rows = np.minimum(np.arange(n), len(twin.speed_mps) - 1)
        self.speed_mps, self.distance_m = twin.speed_mps[rows], twin.distance_m[rows]
        self.friction_nm, self.motor_nm = twin.friction_nm[rows], twin.motor_nm[rows]
        self.asked_nm = twin.asked_nm[rows]
        last = np.minimum(rows, np.flatnonzero(twin.mode >= 0)[-1])
        self.mode, self.faults = twin.mode[last], twin.faults[last]
        self.codes = dict(twin.codes)


def _look_at_reports(m: Measured, trace: Trace, other: _Rows, right: Expected, until_s: float) -> None:
    sent = trace.mode >= 0
    if sent.any():
        m.worst_mode = int(trace.mode[sent].max())
    allowed = {int(mode) for mode in right.modes} | {int(BrakeMode.NORMAL)}
    acting = sent & (np.arange(len(sent)) * TICK_S < until_s)  # afterwards the way back leads through all modes
    wrong = {int(mode) for mode in np.unique(trace.mode[acting])} - allowed - set(other.mode.tolist())
    m.wrong_modes = tuple(BrakeMode(mode).name for mode in sorted(wrong))
    told = 0
    for value in np.unique(trace.faults[sent]):
        told |= int(value)
    before = int(np.bitwise_or.reduce(np.maximum(other.faults, 0)))
    m.wrong_faults = Fault(told & ~before & ~int(right.trouble | _beside(right.trouble)))
    new = [code for code, times in trace.codes if other.codes.get(code) != times]
    m.codes, m.healing = tuple(code.name for code in new), tuple(code.healing for code in new)


def _beside(right: Fault) -> Fault:
    """Bits that name nobody, beside those that do: what is wrong with frames, or with a torque."""
    motors = right & (Fault.MOTOR_FRONT | Fault.MOTOR_REAR)
    return Fault.COMMUNICATION | (Fault.MOTOR_TORQUE if motors else Fault.NONE)


def _look_at_motors(
    m: Measured, trace: Trace, other: _Rows, first: int, seen: int | None, wheels: tuple[int, ...],
    from_controller: bool,
) -> None:  # fmt: skip
    lost = other.motor_nm.sum(axis=1) - trace.motor_nm.sum(axis=1)
    moving = other.speed_mps > STANDING_MPS
    m.lost_nm = float(np.max(lost[first:] * moving[first:], initial=0.0))
    if wheels and (other.motor_nm[first, list(wheels)] > NONE_NM).any():  # else there is nothing to end
        asked = trace.followed_nm if from_controller else trace.asked_nm
        zero = (np.abs(asked[first:][:, list(wheels)]) < NONE_NM).all(axis=1)
        at = np.flatnonzero(zero)
        at_s = (first + int(at[0]) + (0.0 if from_controller else 0.5)) * TICK_S if len(at) else math.inf
        m.motor_zero_ms = 1e3 * (at_s - trace.befallen_s)
    if seen is None or m.lost_nm < LITTLE_NM:
        return
    window = slice(seen, seen + round(_HANDOVER_S / TICK_S))
    gone, extra = lost[window], (trace.friction_nm - other.friction_nm)[window]
    lost_rows = np.flatnonzero(gone >= LITTLE_NM)
    if not len(lost_rows):
        return
    taken = np.flatnonzero((gone >= LITTLE_NM) & (extra >= TAKEN * gone))
    if len(taken):  # from when it is lost, where it is found before
        m.friction_back_ms = 1e3 * TICK_S * int(taken[0] - lost_rows[0])
    elif (gone[lost_rows[0] :] >= LITTLE_NM).all():  # else the motors came back before
        m.friction_back_ms = math.inf


def _look_at_brakes(m: Measured, trace: Trace, other: _Rows, first: int, until_s: float) -> None:
    decel, due = (-np.diff(rows.speed_mps, append=rows.speed_mps[-1]) / TICK_S for rows in (trace, other))
    moving = np.minimum(trace.speed_mps, other.speed_mps) > 0.5
    short = np.where(moving, due - decel, 0.0)[first:]
    m.dip_mps2 = float(max(short.max(initial=0.0), 0.0))
    m.dip_ms = 1e3 * TICK_S * int((short > SHORTFALL_MPS2).sum())
    let_go = moving & (due > SHORTFALL_MPS2) & (decel < HALF * due)
    m.release_ms = 1e3 * TICK_S * int(let_go[first:].sum())
    lost = (other.motor_nm - trace.motor_nm).sum(axis=1)
    total = other.motor_nm.sum(axis=1) + other.friction_nm
    share = np.where(total > LITTLE_NM, lost / np.maximum(total, LITTLE_NM), 0.0)
    m.lost_mps2 = float(np.max((share * due * moving)[first:], initial=0.0))

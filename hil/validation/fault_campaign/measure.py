"""What a fault did to a stop: the trace beside that of its twin without the fault."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dbc.messages import BrakeMode, Fault
from hil.faults.fault import Expected
from hil.validation.fault_campaign.drive import STANDING_MPS, TICK_S, Trace
from hil.validation.fault_campaign.physics import follows_s

Array = NDArray[np.float64]
NONE_NM = 10.0  # motor torque that counts as none: 0.02 m/s2 of the car
LITTLE_NM = 100.0  # regeneration below which its loss is not looked at: 0.2 m/s2
SHORTFALL_MPS2 = 1.0  # budget: deceleration below the demand
TAKEN = 0.9  # budget: share of the lost regeneration that friction gives
HALF = 0.5  # a brake that gives less than half of what is due has let go
NEARLY_STANDING_MPS = 0.5  # below, a stop ends with a jerk of its own
_HANDOVER_S = 1.0  # friction takes over within, or never


@dataclass(slots=True)
class Measured:
    """One run beside its twin; NaN where there is nothing to measure.

    Attributes
    ----------
    detect_ms : first frame befallen (or switch in the car) to the controller's report.
    motor_zero_ms : to no torque demand for what has failed.
    friction_back_ms : report (or the loss, where it comes later) to friction giving 90 % of the lost regeneration.
    friction_bound_ms : the same of a brake that is asked for exactly what is lost.
    dip_mps2, dip_ms : deepest shortfall of deceleration, and how long it was above 1.0 m/s2.
    lost_nm : regeneration that was lost, at its most.
    release_ms : how long the brakes gave less than half of what the driver asked for.
    stop_ratio, longer_m : distance over the twin's, and the difference.
    recovery_ms : end of the fault to the twin's mode.
    worst_mode : while it acted.
    left_s : from the first frame befallen to the stop.
    stale_used, stale_in_all, altered : frames; the first until the fault was found.
    error : what was raised.
    wrong_faults, wrong_modes : what was reported beside what is right.
    codes, healing : trouble codes found, and when each ceases to be active.
    """

    detect_ms: float = math.nan
    motor_zero_ms: float = math.nan
    friction_back_ms: float = math.nan
    friction_bound_ms: float = math.nan
    dip_mps2: float = math.nan
    dip_ms: float = math.nan
    lost_nm: float = math.nan
    release_ms: float = math.nan
    stop_ratio: float = math.nan
    longer_m: float = math.nan
    recovery_ms: float = math.nan
    worst_mode: int = int(BrakeMode.NORMAL)
    befallen_s: float = math.nan
    left_s: float = math.nan
    stale_used: int = 0
    stale_in_all: int = 0
    altered: int = 0
    error: str = ""
    wrong_faults: Fault = Fault.NONE
    wrong_modes: tuple[str, ...] = ()
    codes: tuple[str, ...] = ()
    healing: tuple[str, ...] = ()


def measured(
    trace: Trace,
    twin: Trace,
    right: Expected,
    until_s: float,
    wheels: tuple[int, ...] = (),
    *,
    at_actuators: bool = False,
    only_wheels: bool = False,
) -> Measured:
    """Measure a run.

    Parameters
    ----------
    right : what the controller may do.
    until_s : end of the fault.
    wheels : whose motors it takes away.
    at_actuators : whether it befell what the controller sends: then what the motors follow counts, not the wire.
    only_wheels : whether the regeneration of these motors alone is lost; else of all.
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
    m.stale_in_all = len(trace.stale_s)
    m.stale_used = sum(seen is None or at_s < seen * TICK_S for at_s in trace.stale_s)
    _look_at_motors(m, trace, other, first, list(wheels), at_actuators)
    _look_at_friction(m, trace, other, first, seen, list(wheels) if only_wheels else [0, 1, 2, 3])
    _look_at_brakes(m, trace, other, first)
    if math.isfinite(until_s) and seen is not None:
        end = round(until_s / TICK_S)
        begun, said = max(first, end - 5), np.flatnonzero(trace.mode >= 0)
        if worse[begun:].any():
            last = begun + int(np.flatnonzero(worse[begun:])[-1])
            m.recovery_ms = math.inf if last >= said[-1] else max(0.0, 1e3 * TICK_S * (last + 1 - end))
    retried_later = any(name.startswith("motor_") and name.endswith("_torque") for name in m.codes)
    if retried_later and math.isinf(m.recovery_ms):
        m.recovery_ms = math.nan  # such a motor is tried again some time after the pedal is released: not in this stop
    return m


_PEDALS = Fault.PEDAL_1 | Fault.PEDAL_2


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
    """Bits that name no other part: what is wrong with frames, with a torque, or between two channels."""
    motors = right & (Fault.MOTOR_FRONT | Fault.MOTOR_REAR)
    pedals = right & _PEDALS == _PEDALS
    beside = Fault.COMMUNICATION | (Fault.MOTOR_TORQUE if motors else Fault.NONE)
    return beside | (Fault.PEDAL_DISAGREE if pedals else Fault.NONE)


def _look_at_motors(m: Measured, trace: Trace, other: _Rows, first: int, wheels: list[int], at_actuators: bool) -> None:
    if not wheels or not (other.motor_nm[first, wheels] > NONE_NM).any():  # there is nothing to end
        return
    asked = trace.followed_nm if at_actuators else trace.asked_nm
    zero = np.flatnonzero((np.abs(asked[first:][:, wheels]) < NONE_NM).all(axis=1))
    at_s = (first + int(zero[0]) + (0.0 if at_actuators else 0.5)) * TICK_S if len(zero) else math.inf
    m.motor_zero_ms = 1e3 * (at_s - trace.befallen_s)


def _look_at_friction(m: Measured, trace: Trace, other: _Rows, first: int, seen: int | None, wheels: list[int]) -> None:
    lost = (other.motor_nm - trace.motor_nm)[:, wheels].sum(axis=1)
    m.lost_nm = float(np.max((lost * (other.speed_mps > STANDING_MPS))[first:], initial=0.0))
    if seen is None:
        return
    window = slice(seen, seen + round(_HANDOVER_S / TICK_S))
    gone, extra = lost[window], (trace.friction_nm - other.friction_nm)[window]
    lost_rows = np.flatnonzero(gone >= LITTLE_NM)
    if not len(lost_rows):
        return
    begin = int(lost_rows[0])  # where it is found before it is lost: from the loss
    m.friction_bound_ms = 1e3 * (follows_s(gone, TICK_S, TAKEN, LITTLE_NM) - TICK_S * begin)
    taken = np.flatnonzero((gone >= LITTLE_NM) & (extra >= TAKEN * gone))
    if len(taken):
        m.friction_back_ms = 1e3 * TICK_S * int(taken[0] - begin)
    elif (gone[begin:] >= LITTLE_NM).all():  # else the motors came back before
        m.friction_back_ms = math.inf


def _look_at_brakes(m: Measured, trace: Trace, other: _Rows, first: int) -> None:
    decel, due = (-np.diff(rows.speed_mps, append=rows.speed_mps[-1]) / TICK_S for rows in (trace, other))
    moving = np.minimum(trace.speed_mps, other.speed_mps) > NEARLY_STANDING_MPS
    short = np.where(moving, due - decel, 0.0)[first:]
    m.dip_mps2 = float(max(short.max(initial=0.0), 0.0))
    m.dip_ms = 1e3 * TICK_S * int((short > SHORTFALL_MPS2).sum())
    let_go = moving & (due > SHORTFALL_MPS2) & (decel < HALF * due)
    m.release_ms = 1e3 * TICK_S * int(let_go[first:].sum())

"""What differs from fault to fault: which motors it takes away, when there is anything to find, what is right then."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dbc.messages import BrakeMode
from hil.faults.fault import Expected, Injection, Side
from hil.validation.fault_campaign.drive import TICK_S, Trace, scenario_of
from hil.validation.fault_campaign.measure import LITTLE_NM, Measured, measured

MISSING = {"motor_deaf": 40.0, "motor_weak": 110.0}
"""Torque asked of a motor below which a missing part is not seen: inside the 20 % and 30 Nm of a motor that is well."""
FROM_THE_CONTROLLER = ("EHB_DEMAND_FRONT", "EHB_DEMAND_REAR", "MOTOR_DEMAND_FRONT", "MOTOR_DEMAND_REAR", "ECU")
NO_DIP_MPS2 = 0.3
_SENDERS = ("second_sender", "answering_sender")
_TOLERATED_IN_A_ROW = 2  # frames lost without any reaction (design)
_ALL = (0, 1, 2, 3)
_MOTORS_OF = {
    "MOTOR_STATUS_FRONT": (0, 1),
    "MOTOR_STATUS_REAR": (2, 3),
    "MOTOR_DEMAND_FRONT": (0, 1),
    "MOTOR_DEMAND_REAR": (2, 3),
    **dict.fromkeys(("IWM", "ECU", "PLANT"), _ALL),
}


def measure(trace: Trace, twin: Trace, fault: Injection) -> Measured:
    """Measure the run of one fault beside its twin."""
    wheels, befallen_s = _visible(fault, trace.befallen_s, twin)
    right = right_of(fault, trace)
    of_motors = fault.kind.name.startswith("motor_")
    m = measured(
        replace(trace, befallen_s=befallen_s), twin, right, fault.until_s, wheels,
        at_actuators=_at_actuators(fault), only_wheels=of_motors,
    )  # fmt: skip
    if right.motor_zero_ms is None or not is_seen(m, fault):
        m.motor_zero_ms = math.nan
    if without_car(fault):
        forget_brakes(m)
    return m


def _visible(fault: Injection, befallen_s: float, twin: Trace) -> tuple[tuple[int, ...], float]:
    """Motors that it takes away, and from when anything is to be seen of it: later than the first frame befallen
    where it changes nothing yet."""
    wheels = _motors_of(fault)
    if math.isnan(befallen_s):
        return wheels, befallen_s
    name, target = fault.kind.name, fault.target.name
    if name in _SENDERS and target == "BRAKE_PEDAL":
        return wheels, max(befallen_s, _first_press_s())  # both say the same before
    least = MISSING.get(name, MISSING["motor_deaf"] if name in _SENDERS and target.startswith("MOTOR_DEMAND") else None)
    if least is None:
        return wheels, befallen_s
    asked = twin.motor_nm[int(befallen_s / TICK_S + 1e-6) :]
    due = [_held_above(asked[:, i], least, fault.expected.detect_ms or 0.0) for i in wheels]
    first = min((rows[0] for rows in due if len(rows)), default=None)
    if first is None:
        return (), math.nan
    seen = tuple(i for i, rows in zip(wheels, due, strict=True) if first in rows)
    return seen, befallen_s + int(first) * TICK_S


def _held_above(values: NDArray[np.float64], least: float, for_ms: float) -> NDArray[np.intp]:
    """Rows from which values are above a limit for a time: shorter there is nothing to be found in time."""
    rows = round(for_ms * 1e-3 / TICK_S)
    below = np.concatenate([[0], np.cumsum(values <= least)])
    begins = np.arange(max(len(values) - rows, 0))
    return np.flatnonzero(below[begins + rows] == below[begins])


@cache
def _first_press_s() -> float:
    pedal = scenario_of().manoeuvre.pedal
    return max(at_s for at_s, travel in pedal if travel <= pedal[0][1])


def without_car(fault: Injection) -> bool:
    """Whether the process of the car stands still: a brake's figures say nothing then."""
    return fault.kind.family == "process" and fault.target.name == "PLANT"


def forget_brakes(m: Measured) -> None:
    """Take out what a car that is not stepped cannot show."""
    m.dip_mps2 = m.dip_ms = m.release_ms = m.lost_nm = m.friction_back_ms = math.nan


def on_their_own(fault: Injection) -> bool:
    """Whether the actuators hear no controller: the brake follows its own pedal map."""
    off = fault.kind.family == "link" or (fault.kind.family == "process" and fault.target.name == "ECU")
    return off or fault.target.name.startswith("EHB_DEMAND")


def is_seen(m: Measured, fault: Injection) -> bool:
    """Whether there was anything to find: a frame befallen, for longer than the budget, and not without any effect.

    What is sent under the controller's own name it does not hear: it can see what an actuator makes of it.
    """
    limit_s = (fault.expected.detect_ms or 0.0) * 1e-3
    if math.isnan(m.befallen_s) or fault.until_s - m.befallen_s <= limit_s or m.left_s <= limit_s:
        return False
    harmless = not m.stale_used and m.dip_mps2 < NO_DIP_MPS2 and m.lost_nm < LITTLE_NM
    return not (harmless and of_demands(fault))


def of_demands(fault: Injection) -> bool:
    """Whether it befalls what the controller sends."""
    return fault.target.name in FROM_THE_CONTROLLER and fault.kind.family in ("bus", "protection")


def _motors_of(fault: Injection) -> tuple[int, ...]:
    if fault.kind.name.startswith("motor_"):
        return tuple(i for i in _ALL if fault.target.wheels >> i & 1)
    return _MOTORS_OF.get(fault.target.name.partition(".")[0], ())


def _at_actuators(fault: Injection) -> bool:
    return fault.target.name in FROM_THE_CONTROLLER and fault.kind.side is not Side.PLANT


def right_of(fault: Injection, trace: Trace) -> Expected:
    """What the library expects; more than two frames lost in a row are a silence."""
    right = fault.expected
    if fault.kind.name == "lost" and trace.most_missing > _TOLERATED_IN_A_ROW:
        return replace(right, modes=frozenset(BrakeMode), trouble=right.trouble | fault.target.trouble)
    return right

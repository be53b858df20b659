"""What a fault can be armed on: a signal, a message, all messages of a node, a node, wheels; and its code on a bus."""

import difflib
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from dbc.frame import BusName
from dbc.messages import Fault
from dbc.raw import named_messages, raw_signals
from hil.errors import BrakebenchError

WHOLE_MESSAGE = 15
"""FAULT_SELECT.SIGNAL where the fault is not of one signal."""


class TargetError(BrakebenchError):
    """No such target; the message names the nearest or all."""


class NodeCode(IntEnum):
    """FAULT_SELECT.TARGET of what is no message: beyond the 11-bit identifiers."""

    ECU = 2048
    PLANT = 2049
    DRIVER = 2050
    SENSORS = 2051
    EHB = 2052
    IWM = 2053
    BATTERY = 2054
    RECORDER = 2055
    HOST = 2056
    ALL = 4095


class Takes(StrEnum):
    """Which targets a fault takes."""

    MESSAGES = "message, node or all"
    SIGNAL = "signal"
    SIGNAL_OR_MESSAGE = "signal or message"
    PROCESS = "ECU or PLANT"
    WHEELS = "wheels"
    RECORDER = "RECORDER"
    HOST = "HOST"


PROCESSES = ("ECU", "PLANT")
WHEELS = ("fl", "fr", "rl", "rr")
AXLES = {"front": 0b0011, "rear": 0b1100, "all": 0b1111}

_TROUBLE = {
    "BRAKE_PEDAL": Fault.PEDAL_1 | Fault.PEDAL_2,
    "BRAKE_PEDAL.PEDAL_TRAVEL_1": Fault.PEDAL_1 | Fault.PEDAL_DISAGREE,
    "BRAKE_PEDAL.PEDAL_TRAVEL_2": Fault.PEDAL_2 | Fault.PEDAL_DISAGREE,
    "WHEEL_SPEED_FRONT": Fault.WHEEL_SPEED_FRONT,
    "WHEEL_SPEED_REAR": Fault.WHEEL_SPEED_REAR,
    "BODY_MOTION": Fault.BODY_MOTION,
    "EHB_PRESSURE_FRONT": Fault.EHB_PRESSURE_FRONT,
    "EHB_PRESSURE_REAR": Fault.EHB_PRESSURE_REAR,
    "MOTOR_STATUS_FRONT": Fault.MOTOR_FRONT,
    "MOTOR_STATUS_REAR": Fault.MOTOR_REAR,
    "BATTERY_STATUS": Fault.BATTERY,
    "STEERING": Fault.STEERING,
    "EHB_DEMAND_FRONT": Fault.EHB_OWN_MAP | Fault.EHB_PRESSURE_FRONT,
    "EHB_DEMAND_REAR": Fault.EHB_OWN_MAP | Fault.EHB_PRESSURE_REAR,
    "MOTOR_DEMAND_FRONT": Fault.MOTOR_FRONT,
    "MOTOR_DEMAND_REAR": Fault.MOTOR_REAR,
}


@dataclass(frozen=True, slots=True)
class Target:
    """What a fault acts on.

    Attributes
    ----------
    name : as it was asked for.  code, signal : on the bench bus.
    nodes : DBC nodes that play it; the process of one of them carries the fault.
    can_ids : identifiers on the vehicle bus.
    wheels : bits, 0 for fl; of faults of the car.
    trouble : what a controller reports when it is not to be trusted.
    """

    name: str
    code: int
    signal: int
    nodes: frozenset[str]
    can_ids: frozenset[int]
    wheels: int = 0
    trouble: Fault = Fault.NONE

    def __str__(self) -> str:
        return self.name


def target_named(name: str, takes: Takes, fault: str) -> Target:
    """The target of a name, of a kind that the fault takes.

    Names: ``MESSAGE``, ``MESSAGE.SIGNAL``, a node (``SENSORS``), ``ECU`` or ``PLANT`` for a process, ``ALL``, and for
    the car a wheel, several (``fl,rr``), ``front``, ``rear`` or ``all``.

    Raises
    ------
    TargetError
        No such thing, or one that the fault does not take.
    """
    if takes is Takes.WHEELS:
        return _wheels(name, fault)
    known = _names(takes)
    if name not in known:
        close = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
        raise TargetError(f"fault {fault}: cannot be armed on {name!r}; it takes: {takes.value}; {hint}")
    return known[name]


def target_coded(code: int, signal: int, takes: Takes) -> Target | None:
    """The target of a code and signal on the bench bus; None where the fault takes no such."""
    return next((t for t in _names(takes).values() if (t.code, t.signal) == (code, signal)), None)


def target_names(takes: Takes) -> tuple[str, ...]:
    """Everything that a fault can be armed on."""
    return (*WHEELS, *AXLES) if takes is Takes.WHEELS else tuple(_names(takes))


def _wheels(name: str, fault: str) -> Target:
    bits = AXLES.get(name, 0)
    if not bits:
        for part in (part.strip() for part in name.split(",")):
            if part not in WHEELS:
                raise TargetError(
                    f"fault {fault}: wheel {part!r}: expected {', '.join(WHEELS)}, several of them (fl,rr), "
                    f"or {', '.join(AXLES)}"
                )
            bits |= 1 << WHEELS.index(part)
    return Target(name, NodeCode.PLANT, WHOLE_MESSAGE, frozenset({"PLANT"}), frozenset(), bits)


_CACHE: dict[Takes, dict[str, Target]] = {}


def _names(takes: Takes) -> dict[str, Target]:
    if takes not in _CACHE:
        _CACHE[takes] = _build(takes)
    return _CACHE[takes]


def _build(takes: Takes) -> dict[str, Target]:
    found: dict[str, Target] = {}
    messages = named_messages(BusName.VEHICLE)
    if takes is Takes.PROCESS:
        return {name: Target(name, NodeCode[name], WHOLE_MESSAGE, frozenset({name}), frozenset()) for name in PROCESSES}
    if takes in (Takes.RECORDER, Takes.HOST):
        name = takes.value
        return {name: Target(name, NodeCode[name], WHOLE_MESSAGE, frozenset({name}), frozenset())}
    for spec in messages.values():
        ids, nodes = frozenset({spec.can_id}), frozenset({spec.sender})
        trouble = _TROUBLE.get(spec.name, Fault.NONE)
        if takes is not Takes.SIGNAL:
            found[spec.name] = Target(spec.name, spec.can_id, WHOLE_MESSAGE, nodes, ids, trouble=trouble)
        if takes is not Takes.MESSAGES:
            for index, signal in enumerate(raw_signals(BusName.VEHICLE)[spec.name]):
                name = f"{spec.name}.{signal.name}"
                found[name] = Target(name, spec.can_id, index, nodes, ids, trouble=_TROUBLE.get(name, trouble))
    if takes is Takes.MESSAGES:
        for node in (n for n in NodeCode if n.name not in ("PLANT", "RECORDER", "HOST", "ALL")):
            found[node.name] = _of_senders(node.name, node, frozenset({node.name}))
        found["PLANT"] = _of_senders("PLANT", NodeCode.PLANT, frozenset({"DRIVER", "SENSORS", "EHB", "IWM", "BATTERY"}))
        found["ALL"] = _of_senders("ALL", NodeCode.ALL, frozenset(spec.sender for spec in messages.values()))
    return found


def _of_senders(name: str, code: int, senders: frozenset[str]) -> Target:
    mine = [spec for spec in named_messages(BusName.VEHICLE).values() if spec.sender in senders]
    trouble = Fault.NONE
    for spec in mine:
        trouble |= _TROUBLE.get(spec.name, Fault.NONE)
    return Target(name, code, WHOLE_MESSAGE, senders, frozenset(spec.can_id for spec in mine), trouble=trouble)

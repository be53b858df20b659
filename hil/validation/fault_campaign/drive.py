"""One stop under armed faults in virtual time, and what is noted of it at every tick of the bus."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dbc.bench_messages import TruthFrictionTorque
from dbc.contract import Message, contract, spec_of
from dbc.exchange import Receiver
from dbc.frame import BusName, Frame, Node, Received
from dbc.messages import (
    BrakeMode,
    BrakeStatus,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorDemandFront,
    MotorDemandRear,
)
from ecu.law.trouble_codes import TroubleCode
from ecu.node import EcuNode
from hil.bench.node_process import NODE_PERIOD_NS
from hil.bench.stimulus import StimulusNode
from hil.bench.virtual import members, own_nodes
from hil.faults.act import message_of
from hil.faults.fault import Injection, Side
from hil.rt.lockstep import Member, lockstep
from hil.scenario.scenario import Scenario, load_scenario
from hil.validation.fault_campaign.cases import SCENARIO
from plant.demands import DEMAND_TIMEOUT_NS
from plant.layout import Vector
from plant.node import PlantNode
from plant.vectors import INPUT, STATE

TICK_S = NODE_PERIOD_NS * 1e-9
STANDING_MPS = 0.02
_SETTLED_S = 0.2  # standing for so long ends a run
_LONGEST_S = 30.0
LONGEST_RECOVERY_S = 9.0  # healing of 5 s, three upgrades, and some
_BACK_S, _BACK_ROWS = 0.2, 10
_GONE_S = 1.0  # a run whose car is gone ends so long after it
_PLANT, _ECU = 0, 1
_SPEED, _DISTANCE = STATE.slice("speed_mps").start, STATE.slice("distance_m").start
_MOTOR, _MOTOR_ASKED = STATE.slice("motor_torque_nm"), INPUT.slice("motor_demand_nm")
_FRICTION = spec_of(TruthFrictionTorque)
_STATUS = spec_of(BrakeStatus)
_MOTOR_DEMANDS = {spec_of(kind).can_id: (2 * axle, spec_of(kind)) for axle, kind in
                  enumerate((MotorDemandFront, MotorDemandRear))}  # fmt: skip
_PRESSURES = {spec_of(kind).can_id: spec_of(kind) for kind in (EhbPressureFront, EhbPressureRear)}
_VALID_BY_ITSELF = frozenset({"bits_altered"})


@dataclass(slots=True)
class Trace:
    """What was noted at every tick of the bus since the manoeuvre's start; one row each.

    Attributes
    ----------
    speed_mps, distance_m : of the car.
    friction_nm, motor_nm : braking torque of all wheels, of each motor; positive where it brakes.
    followed_nm : torque that each motor is asked for in the end; asked_nm : on the wire, NaN where not sent.
    mode, faults : on the wire; -1 where not sent.
    befallen_s : manoeuvre time of the first frame (or tick) that a fault befell; NaN: none.
    altered : frames that a fault altered.
    stale_s : when a receiver took a frame for fresh although its sender had not sent its values within the time-out.
    own_map : whether the brake followed its own pedal map.
    codes : trouble codes that the controller has in its memory, and how often each was found.
    error : what was raised; empty.
    """

    speed_mps: NDArray[np.float64]
    distance_m: NDArray[np.float64]
    friction_nm: NDArray[np.float64]
    motor_nm: NDArray[np.float64]
    followed_nm: NDArray[np.float64]
    asked_nm: NDArray[np.float64]
    mode: NDArray[np.int64]
    faults: NDArray[np.int64]
    befallen_s: float = math.nan
    altered: int = 0
    stale_s: tuple[float, ...] = ()
    own_map: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    codes: tuple[tuple[TroubleCode, int], ...] = ()
    error: str = ""


class _Inside:
    """A node behind the faults: keeps what reached it and what it sent."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.called = False
        self.inbox: list[Received] = []
        self.frames: list[Frame] = []

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        self.called = True
        self.inbox = inbox
        self.frames = self._node.step(now_ns, inbox)
        return self.frames


class _Outside:
    """The same node as its bus sees it: tells at which ticks faults befell it."""

    def __init__(self, node: Node, inside: _Inside) -> None:
        self._node = node
        self._inside = inside
        self.befallen = False
        self.altered = 0
        self.frames: list[Frame] = []

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        inside = self._inside
        inside.called = False
        sent = self.frames = self._node.step(now_ns, inbox)
        if not inside.called:
            inside.frames = []
        heard = inside.inbox is inbox or inside.inbox == inbox
        passed = sent is inside.frames or sent == inside.frames
        self.befallen = not (inside.called and heard and passed)
        if not passed:
            truly = set(inside.frames)
            self.altered += sum([frame not in truly for frame in sent])
        return sent


class _Freshness:
    """Compares what a receiver took for fresh with what the sender meant to send within the time-out.

    Counter and check value apart: a wrong counter beside values of now does no harm.
    """

    def __init__(self, can_ids: Sequence[int], sender: _Inside, receiver: Receiver) -> None:
        by_id = {r.spec.can_id: r for r in receiver.receptions.values() if r.spec.bus is BusName.VEHICLE}
        self._watched = [by_id[can_id] for can_id in can_ids if can_id in by_id]
        self._true: dict[int, deque[tuple[int, Message]]] = {r.spec.can_id: deque() for r in self._watched}
        self._sender = sender

    def sent(self, now_ns: int) -> None:
        """Note what the sender meant to send at this tick."""
        for frame in self._sender.frames:
            if frame.can_id in self._true and frame.bus is BusName.VEHICLE:
                self._true[frame.can_id].append((now_ns, message_of(frame.can_id).decode(frame.data)))

    def stale(self, now_ns: int) -> int:
        """How many of the messages that were taken now are neither of now nor of the time-out before."""
        found = 0
        for reception in self._watched:
            true = self._true[reception.spec.can_id]
            while true and true[0][0] < now_ns - DEMAND_TIMEOUT_NS - reception.spec.cycle_ns:
                true.popleft()
            if reception.fresh and not any(message == reception.message for _, message in true):
                found += 1
        return found


@dataclass(slots=True)
class _Notes:
    """Rows as they come."""

    car: list[tuple[float, float, float]] = field(default_factory=list)
    motor: list[Vector] = field(default_factory=list)
    followed: list[Vector] = field(default_factory=list)
    asked: list[list[float]] = field(default_factory=list)
    status: list[list[int]] = field(default_factory=list)
    own_map: list[bool] = field(default_factory=list)


@lru_cache(maxsize=8)
def scenario_of(timeout_s: float | None = None) -> Scenario:
    """The manoeuvre without its end (a run ends when all is seen), the controller with another time-out."""
    scenario = load_scenario(SCENARIO)
    manoeuvre = replace(scenario.manoeuvre, duration_s=2.0 * _LONGEST_S, end_after_standstill_s=None)
    ecu = scenario.ecu
    if timeout_s is not None:
        supervision = replace(ecu.supervision, timeout_s=timeout_s)
        ecu = replace(ecu, supervision=supervision)
    return replace(scenario, manoeuvre=manoeuvre, ecu=ecu)


def drive(seed: int, faults: Sequence[Injection], timeout_s: float | None = None) -> Trace:
    """Drive the stop under faults until the car stands, and until the mode is back where all faults end.

    An error of a node ends the run and stands in the trace.
    """
    scenario = scenario_of(timeout_s)
    plant, ecu = own_nodes(scenario, seed)
    assert isinstance(plant, PlantNode)
    assert isinstance(ecu, EcuNode)
    stimulus = StimulusNode(scenario.blending, faults, seed=seed)
    inside = [_Inside(plant), _Inside(ecu)]
    taking_part = members(scenario, inside[0], inside[1], stimulus)
    outside = [_Outside(taking_part[k].node, inside[k]) for k in (_PLANT, _ECU)]
    for k in (_PLANT, _ECU):
        taking_part[k] = Member(outside[k], taking_part[k].period_ns, taking_part[k].phase_ns)
    can_ids = sorted({can_id for fault in faults for can_id in _judged_ids(fault)})
    taken = [_Freshness(can_ids, inside[_ECU], plant.receiver), _Freshness(can_ids, inside[_PLANT], ecu.receiver)]
    ended_s = max((f.until_s for f in faults), default=math.inf)
    physical_s = min((f.at_s for f in faults if f.kind.side is Side.PLANT), default=math.inf)

    notes, error = _Notes(), ""
    befallen_s = math.nan
    stale_s: list[float] = []
    standing_since_s = math.nan
    try:
        for now_ns, member, frames in lockstep(taking_part):
            if member > _ECU:
                if plant.manoeuvre_start_ns is None and now_ns > 15_000_000_000:
                    raise RuntimeError("the manoeuvre did not start within 15 s")
                continue
            start_ns = plant.manoeuvre_start_ns
            taken[1 - member].sent(now_ns)
            if start_ns is None:
                continue
            time_s = (now_ns - start_ns) * 1e-9
            if inside[member].called:
                stale_s += [time_s] * taken[member].stale(now_ns)
            if outside[member].befallen and math.isnan(befallen_s):
                befallen_s = time_s
            if member == _PLANT:
                if time_s >= physical_s - 1e-9 and math.isnan(befallen_s):
                    befallen_s = time_s
                _note_car(notes, plant, inside[_PLANT].frames)
                speed = notes.car[-1][0]
                if speed > STANDING_MPS:
                    standing_since_s = math.nan
                elif math.isnan(standing_since_s):
                    standing_since_s = time_s
                stood = time_s - standing_since_s >= _SETTLED_S and _recovered(notes, time_s - ended_s)
                gone = not inside[_PLANT].called and time_s > befallen_s + _GONE_S
                if stood or gone or time_s > _LONGEST_S:
                    break
            elif notes.car:
                _note_controller(notes, inside[_ECU].frames)
    except Exception as raised:
        error = f"{type(raised).__name__}: {raised}"
    speed, distance, friction = np.array(notes.car or [(math.nan,) * 3]).T
    status = np.array(notes.status or [[-1, -1]])
    return Trace(
        speed, distance, friction,
        -np.array(notes.motor or [[math.nan] * 4]), -np.array(notes.followed or [[math.nan] * 4]),
        -np.array(notes.asked or [[math.nan] * 4]), status[:, 0], status[:, 1],
        befallen_s, outside[0].altered + outside[1].altered, tuple(stale_s), np.array(notes.own_map, bool),
        tuple((t.code, t.occurrences) for t in ecu.trouble_codes), error,
    )  # fmt: skip


def _judged_ids(fault: Injection) -> frozenset[int]:
    """Messages whose frames the protection can tell from what was meant; a sensor's own lie it cannot."""
    if fault.kind.family in ("bus", "protection") and fault.kind.name not in _VALID_BY_ITSELF:
        return fault.target.can_ids or frozenset(contract(BusName.VEHICLE).by_id)
    return frozenset()


def _recovered(notes: _Notes, since_s: float) -> bool:
    """Whether there is nothing to wait for any more, so long after the end of the faults (negative: they act)."""
    if since_s < 0.0 or since_s > LONGEST_RECOVERY_S:
        return True
    return since_s > _BACK_S and all(mode in (-1, int(BrakeMode.NORMAL)) for mode, _ in notes.status[-_BACK_ROWS:])


def _note_car(notes: _Notes, plant: PlantNode, frames: Sequence[Frame]) -> None:
    state = plant.model_state
    friction, own_map = math.nan, False
    for frame in frames:
        if frame.can_id == _FRICTION.can_id and frame.bus is _FRICTION.bus:
            friction = -sum([value or 0.0 for value in _FRICTION.decode(frame.data)])
        elif frame.can_id in _PRESSURES and frame.bus is BusName.VEHICLE:
            own_map |= _PRESSURES[frame.can_id].decode(frame.data)[2] is EhbState.OWN_PEDAL_MAP
    notes.car.append((float(state[_SPEED]), float(state[_DISTANCE]), friction))
    notes.motor.append(state[_MOTOR])
    notes.followed.append(plant.inputs[_MOTOR_ASKED])
    notes.asked.append([math.nan] * 4)
    notes.status.append([-1, -1])
    notes.own_map.append(own_map)


def _note_controller(notes: _Notes, frames: Sequence[Frame]) -> None:
    """Fill the row of this tick."""
    for frame in frames:
        if frame.bus is not BusName.VEHICLE:
            continue
        if frame.can_id == _STATUS.can_id:
            mode, faults, *_ = _STATUS.decode(frame.data)
            notes.status[-1] = [-1 if mode is None else int(mode), faults or 0]
        elif frame.can_id in _MOTOR_DEMANDS:
            first, spec = _MOTOR_DEMANDS[frame.can_id]
            values = spec.decode(frame.data)
            notes.asked[-1][first : first + 2] = [math.nan if value is None else value for value in values]

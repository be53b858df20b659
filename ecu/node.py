"""The controller on the bus: frames in, control law, frames out."""

import math
from typing import Any

from dbc.batch import Batch
from dbc.bench_messages import EcuReception, StimulusEcu
from dbc.contract import spec_of
from dbc.diagnostic_ids import REQUESTS
from dbc.exchange import Receiver
from dbc.frame import BusName, Frame, LinkState, Received
from dbc.intake import BAD_IN_ROW, FRESH, LAST_VALID_NS, RECEIVED
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakeEstimateFront,
    BrakeEstimateRear,
    BrakePedal,
    BrakeStatus,
    BrakeTroubleCode,
    EhbDemandFront,
    EhbDemandRear,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorDemandFront,
    MotorDemandRear,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    TroubleStatus,
    WheelSpeedFront,
    WheelSpeedRear,
)
from dbc.reception import Reception
from ecu.diagnostics.exchange import Orders, View, instead
from ecu.diagnostics.server import DiagnosticServer
from ecu.law.step import asked_instead, initial_memory, step
from ecu.law.trouble_codes import Trouble, forget
from ecu.law.types import OTHERS_WELL, UNKNOWN, WELL, ZERO, Brake, Four, Health, Inputs, Outputs
from ecu.parameters.ecu import EcuParameters

SOURCES: tuple[type[tuple[Any, ...]], ...] = (  # in the order of law.types.Source
    BrakePedal,
    WheelSpeedFront,
    WheelSpeedRear,
    BodyMotion,
    EhbPressureFront,
    EhbPressureRear,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    BatteryStatus,
)
SENT: tuple[type[tuple[Any, ...]], ...] = (
    EhbDemandFront, EhbDemandRear, MotorDemandFront, MotorDemandRear, BrakeStatus, BrakeEstimateFront,
    BrakeEstimateRear, BrakeTroubleCode,
)  # fmt: skip
_DEMANDS = frozenset(spec_of(kind).can_id for kind in SENT[:4])
_NOTHING_ODD = (0, 0, 0)
_OTHERS = len(SOURCES) - 1  # all but the battery, the last
_new = tuple.__new__  # without the Python-made one of a NamedTuple
_FAILED = float(MotorState.FAILED)
_OWN_MAP = Brake.OWN_MAP
_NO_TROUBLE = BrakeTroubleCode(0, TroubleStatus.NONE, 0, 0, 0)
_MOST_CODES = 255
_LINK_DOWN = {LinkState.BUS_OFF: True, LinkState.DISCONNECTED: True, LinkState.RESTARTED: False}
_LINK_DOWN[LinkState.ERROR_ACTIVE] = False
_BRAKE: dict[float, Brake] = {
    EhbState.DEMAND: Brake.DEMAND,
    EhbState.OWN_PEDAL_MAP: Brake.OWN_MAP,
    EhbState.FAILED: Brake.FAILED,
}


def _health(reception: Reception, now_ns: int) -> Health:
    """Supply of a source that is not well."""
    r, memory = reception, reception.memory
    odd = (r.bad, r.foreign, r.doubled) if r.odd_ns == now_ns else _NOTHING_ODD
    age_s = (now_ns - memory[LAST_VALID_NS]) * 1e-9 if memory[RECEIVED] else math.inf
    return _new(Health, (age_s, memory[FRESH] != 0, memory[BAD_IN_ROW], *odd))


class EcuNode:
    """The brake controller as a participant of the bus (see `dbc.frame.Node`).

    Parameters
    ----------
    parameters : the controller's parameter set.
    period_ns : time between two steps.

    Attributes
    ----------
    memory, outputs : state of the control law, and what it gave in the last step (None before the first).
    diagnostics : answers testers; it sees the law's step and gives orders, which the node carries out.
    """

    def __init__(self, parameters: EcuParameters, period_ns: int = 10_000_000) -> None:
        self.parameters = self._set = parameters
        self.period_ns = period_ns
        self.diagnostics = DiagnosticServer(period_ns)
        self._pressure_zero_pa = ZERO
        self.memory = initial_memory(parameters)
        self.outputs: Outputs | None = None
        self._receiver = Receiver((*SOURCES, StimulusEcu), own=SENT, others=REQUESTS)
        self._receptions = [self._receiver.receptions[t] for t in SOURCES]
        self._batch = Batch((*SENT, EcuReception))
        self._last_ns: int | None = None
        self._link_down = self._silenced = False
        self._next_code = 0

    @property
    def receiver(self) -> Receiver:
        """What it has taken of what was sent to it, for who watches."""
        return self._receiver

    @property
    def trouble_codes(self) -> tuple[Trouble, ...]:
        """Every trouble code found since the start, active or not, in order of appearance."""
        return self.memory.troubles.troubles

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Advance to ``now_ns`` and return the frames to send."""
        self._receiver.accept(now_ns, inbox)
        for event in self._receiver.link_events:
            if event.bus is BusName.VEHICLE:
                self._link_down = _LINK_DOWN.get(event.state, self._link_down)
        elapsed_ns = self.period_ns if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        inputs = self._inputs(now_ns)
        self.memory, self.outputs = step(self.memory, inputs, self.parameters, elapsed_ns * 1e-9)
        diagnostics = self.diagnostics
        if self._receiver.others or diagnostics.awake or self.memory.troubles is not diagnostics.troubles:
            return self._diagnose(now_ns, inputs, self.outputs)
        return self._tell(now_ns, self.outputs)

    def farewell(self, now_ns: int) -> list[Frame]:
        """Return the demands of the safe state, to be sent last: no motor torque, the brake by its own pedal map.

        Nothing on the vehicle bus where a tester has silenced the node, or where it has sent nothing yet.
        """
        if self.outputs is None or self._silenced:
            return []
        outputs = self.outputs._replace(pressure_demand_pa=UNKNOWN, motor_demand_nm=ZERO)
        return [frame for frame in self._tell(now_ns, outputs) if frame.can_id in _DEMANDS]

    def _diagnose(self, now_ns: int, inputs: Inputs, outputs: Outputs) -> list[Frame]:
        """End a tick in which diagnostics take part: frames to send, theirs last."""
        m, zero = self.memory, self._pressure_zero_pa
        view = View(m.time_s, inputs, outputs, m.estimates, m.friction, m.troubles, self.parameters, zero)
        answers, orders = self.diagnostics.step(now_ns, self._receiver.others, view)
        if orders.pressure_pa is not None or orders.motor_nm is not None:
            pressure = instead(outputs.pressure_demand_pa, orders.pressure_pa)
            motor = instead(outputs.motor_demand_nm, orders.motor_nm)
            self.memory, self.outputs = asked_instead(m, outputs, pressure, motor)
        frames = self._tell(now_ns, self.outputs or outputs)
        self._silenced = orders.silent and not orders.restart  # a reset ends the session that silenced it
        if orders.silent:
            frames = [frame for frame in frames if frame.bus is not BusName.VEHICLE]
        self._obey(orders)
        return [*frames, *answers]

    def _obey(self, orders: Orders) -> None:
        """Carry out what changes the node from the next tick on."""
        if orders.forget:
            self.memory = self.memory._replace(troubles=forget(self.memory.troubles, orders.forget))
        if orders.parameters is not None:
            self.parameters = orders.parameters
        if orders.pressure_zero_pa is not None:
            self._pressure_zero_pa = orders.pressure_zero_pa
        if orders.hard:
            self.parameters, self._pressure_zero_pa = self._set, ZERO
        if orders.restart:
            self.memory = initial_memory(self.parameters)

    def _inputs(self, now_ns: int) -> Inputs:
        """What the receiver holds, as the law takes it."""
        (
            pedal_1, pedal_2, speed_fl, speed_fr, speed_rl, speed_rr, acceleration_x, acceleration_y, yaw_rate,
            pressure_fl, pressure_fr, brake_front, pressure_rl, pressure_rr, brake_rear,
            current_fl, able_fl, state_fl, current_fr, able_fr, state_fr,
            current_rl, able_rl, state_rl, current_rr, able_rr, state_rr,
            steering, _, charge_power, blending_factor,
        ) = self._receiver.values.tolist()  # fmt: skip
        pressure: Four = (pressure_fl, pressure_fr, pressure_rl, pressure_rr)
        if self._pressure_zero_pa is not ZERO:
            zero = self._pressure_zero_pa
            pressure = (pressure_fl - zero[0], pressure_fr - zero[1], pressure_rl - zero[2], pressure_rr - zero[3])
        well = self._receiver.well
        if 0 not in well[:_OTHERS]:  # mostly
            health = (*OTHERS_WELL, WELL if well[_OTHERS] else _health(self._receptions[_OTHERS], now_ns))
        else:
            sources = zip(well, self._receptions, strict=False)  # the last reception is no source
            health = tuple([WELL if one else _health(r, now_ns) for one, r in sources])
        return _new(
            Inputs,
            (
                pedal_1,
                pedal_2,
                (speed_fl, speed_fr, speed_rl, speed_rr),
                acceleration_x,
                acceleration_y,
                yaw_rate,
                pressure,
                (_BRAKE.get(brake_front, _OWN_MAP), _BRAKE.get(brake_rear, _OWN_MAP)),
                (current_fl, current_fr, current_rl, current_rr),
                (able_fl, able_fr, able_rl, able_rr),
                # a motor that does not say has failed
                (not state_fl < _FAILED, not state_fr < _FAILED, not state_rl < _FAILED, not state_rr < _FAILED),
                steering,
                charge_power,
                blending_factor,
                self._link_down,
                self._receiver.own_heard > 0,
                health,
            ),
        )

    def _trouble(self, now_ns: int) -> BrakeTroubleCode:
        """The trouble code that is told next: one after the other, without end."""
        troubles = self.memory.troubles.troubles
        if not troubles:
            return _NO_TROUBLE
        index = self._next_code % len(troubles)
        self._next_code = index + self._batch.due(BrakeTroubleCode, now_ns)
        code, active, occurrences, *_ = troubles[index]
        status = TroubleStatus.ACTIVE if active else TroubleStatus.STORED
        return BrakeTroubleCode(code.number, status, occurrences, min(len(troubles), _MOST_CODES), index)

    def _tell(self, now_ns: int, o: Outputs) -> list[Frame]:
        """The law's outputs as frames, with the report of what was consumed."""
        p, m, t, mu, c = o.pressure_demand_pa, o.motor_demand_nm, o.wheel_torque_nm, o.pad_friction, o.confidence
        receiver = self._receiver
        self._batch.write(
            *p,
            *m,
            *(o.mode, o.faults, o.blending_factor, o.demanded_deceleration_mps2),
            *(t[0], mu[0], c[0], t[1], mu[1], c[1]),
            *(t[2], mu[2], c[2], t[3], mu[3], c[3]),
            *self._trouble(now_ns),
            *receiver.counters[: len(SOURCES)],
            *(receiver.lost, receiver.corrupt),
        )
        return self._batch.frames(now_ns)

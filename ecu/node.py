"""The controller on the bus: frames in, control law, frames out."""

import math
from typing import Any

from dbc.bench_messages import EcuReception, StimulusEcu
from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, LinkState, Received
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
from ecu.law.step import initial_memory, step
from ecu.law.trouble_codes import Trouble
from ecu.law.types import WELL, Brake, Health, Inputs, Outputs
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
_NO_COUNTER = 15
_NO_TROUBLE = BrakeTroubleCode(0, TroubleStatus.NONE, 0, 0, 0)
_MOST_CODES = 255
_LINK_DOWN = {LinkState.BUS_OFF: True, LinkState.DISCONNECTED: True, LinkState.RESTARTED: False}
_LINK_DOWN[LinkState.ERROR_ACTIVE] = False
_BRAKE = {EhbState.DEMAND: Brake.DEMAND, EhbState.OWN_PEDAL_MAP: Brake.OWN_MAP, EhbState.FAILED: Brake.FAILED}


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _four(front: Any, rear: Any, first: int, second: int) -> tuple[float, float, float, float]:
    """Values of four wheels out of a front and a rear message (None: never received)."""
    fl, fr = (math.nan, math.nan) if front is None else (_number(front[first]), _number(front[second]))
    rl, rr = (math.nan, math.nan) if rear is None else (_number(rear[first]), _number(rear[second]))
    return (fl, fr, rl, rr)


def _brake(message: Any) -> Brake:
    """State of an axle's brake; one that does not say what it follows is not taken for one that follows us."""
    return Brake.OWN_MAP if message is None or message[2] is None else _BRAKE[message[2]]


def _health(reception: Reception, now_ns: int) -> Health:
    r = reception
    if r.odd_ns != now_ns:
        if r.fresh and not r.bad_in_row:  # mostly
            return WELL
        odd = (0, 0, 0)
    else:
        odd = (r.bad, r.foreign, r.doubled)
    last_ns = r.last_valid_ns
    age_s = math.inf if last_ns is None else (now_ns - last_ns) * 1e-9
    return Health(age_s, r.fresh, r.bad_in_row, *odd)


class EcuNode:
    """The brake controller as a participant of the bus (see `dbc.frame.Node`).

    Parameters
    ----------
    parameters : the controller's parameter set.
    period_ns : time between two steps.

    Attributes
    ----------
    memory, outputs : state of the control law, and what it gave in the last step (None before the first).
    """

    def __init__(self, parameters: EcuParameters, period_ns: int = 10_000_000) -> None:
        self.parameters = parameters
        self.period_ns = period_ns
        self.memory = initial_memory(parameters)
        self.outputs: Outputs | None = None
        self._receiver = Receiver((*SOURCES, StimulusEcu))
        self._receptions = [self._receiver.receptions[t] for t in SOURCES]
        self._transmitter = Transmitter()
        self._last_ns: int | None = None
        self._link_down = False
        self._next_code = 0

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
        self.memory, self.outputs = step(self.memory, self._inputs(now_ns), self.parameters, elapsed_ns * 1e-9)
        return self._transmitter.frames(now_ns, self._outgoing(self.outputs))

    def _inputs(self, now_ns: int) -> Inputs:
        """What the receiver holds, as the law takes it."""
        pedal, speed_f, speed_r, body, ehb_f, ehb_r, motor_f, motor_r, steering, battery = (
            r.message for r in self._receptions
        )
        stimulus = self._receiver.receptions[StimulusEcu].message
        return Inputs(
            pedal_1=math.nan if pedal is None else _number(pedal[0]),
            pedal_2=math.nan if pedal is None else _number(pedal[1]),
            wheel_speed_rad_s=_four(speed_f, speed_r, 0, 1),
            acceleration_x_mps2=math.nan if body is None else _number(body[0]),
            acceleration_y_mps2=math.nan if body is None else _number(body[1]),
            yaw_rate_rad_s=math.nan if body is None else _number(body[2]),
            pressure_pa=_four(ehb_f, ehb_r, 0, 1),
            brake=(_brake(ehb_f), _brake(ehb_r)),
            motor_current_a=_four(motor_f, motor_r, 0, 3),
            motor_available_nm=_four(motor_f, motor_r, 1, 4),
            motor_failed=(_failed(motor_f, 2), _failed(motor_f, 5), _failed(motor_r, 2), _failed(motor_r, 5)),
            steering_wheel_angle_rad=math.nan if steering is None else _number(steering[0]),
            charge_power_w=math.nan if battery is None else _number(battery[1]),
            blending_factor=math.nan if stimulus is None else _number(stimulus[0]),
            link_down=self._link_down,
            health=tuple([_health(reception, now_ns) for reception in self._receptions]),
        )

    def _trouble(self) -> BrakeTroubleCode:
        """The trouble code that is told next: one after the other, without end."""
        troubles = self.memory.troubles.troubles
        if not troubles:
            return _NO_TROUBLE
        index = self._next_code % len(troubles)
        self._next_code = index + self._transmitter.due(BrakeTroubleCode, self._last_ns or 0)
        code, active, occurrences, *_ = troubles[index]
        status = TroubleStatus.ACTIVE if active else TroubleStatus.STORED
        return BrakeTroubleCode(code.number, status, occurrences, min(len(troubles), _MOST_CODES), index)

    def _outgoing(self, o: Outputs) -> tuple[tuple[Any, ...], ...]:
        """The law's outputs as messages, with the report of what was consumed."""
        p, m, t, mu, c = o.pressure_demand_pa, o.motor_demand_nm, o.wheel_torque_nm, o.pad_friction, o.confidence
        counters = [_NO_COUNTER if (n := self._receiver.counter(t)) is None else n for t in SOURCES]
        return (
            EhbDemandFront(p[0], p[1]),
            EhbDemandRear(p[2], p[3]),
            MotorDemandFront(m[0], m[1]),
            MotorDemandRear(m[2], m[3]),
            BrakeStatus(o.mode, int(o.faults), o.blending_factor, o.demanded_deceleration_mps2),
            BrakeEstimateFront(t[0], mu[0], c[0], t[1], mu[1], c[1]),
            BrakeEstimateRear(t[2], mu[2], c[2], t[3], mu[3], c[3]),
            self._trouble(),
            EcuReception._make((*counters, self._receiver.lost, self._receiver.corrupt)),
        )


def _failed(message: Any, index: int) -> bool:
    """Whether a motor reports that it has failed, or does not say."""
    return message is None or message[index] is None or message[index] is MotorState.FAILED

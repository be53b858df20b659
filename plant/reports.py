"""What the plant tells: the frames of the car's nodes, and the truth."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dbc.batch import Batch
from dbc.bench_messages import (
    ManoeuvreState,
    PlantReception,
    TruthDiscTemperature,
    TruthEnergy,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    TruthMotion,
    TruthPadFriction,
    TruthWheelLoad,
    TruthWheelTorque,
)
from dbc.compiled import writer
from dbc.contract import Message, spec_of
from dbc.exchange import Receiver
from dbc.frame import Frame
from dbc.messages import (
    BatteryStatus,
    BodyMotion,
    BrakePedal,
    EhbPressureFront,
    EhbPressureRear,
    EhbState,
    MotorState,
    MotorStatusFront,
    MotorStatusRear,
    Steering,
    WheelSpeedFront,
    WheelSpeedRear,
)
from plant.compiled import exact_entry
from plant.demands import DEMANDS
from plant.layout import Layout, Vector
from plant.sensors import SENSED, N
from plant.vectors import OUTPUT, STATE, P, S, X, Y

DERIVED = Layout(
    "Derived",
    {
        "current_a": 4, "motor_state": 4, "pad_friction": 4,
        "ehb_state": 2, "manoeuvre": 1, "demand_counter": 4, "lost": 1, "corrupt": 1,
    },
)  # fmt: skip
"""What a node says beside what is measured: of it follows the first part, the plant's nodes set the rest."""
D = DERIVED.at
_FAILED, _OK, _DERATED = float(MotorState.FAILED), float(MotorState.OK), float(MotorState.DERATED)


def _indices(layout: Layout, start: int) -> Callable[..., list[int]]:
    def of(part: str, first: int = 0, last: int | None = None) -> list[int]:
        return [start + k for k in range(layout.size)[layout.slice(part)][first:last]]

    return of


# a value's place in state, outputs, what is measured, and what is derived, one after the other
_X = _indices(STATE, 0)
_Y = _indices(OUTPUT, STATE.size)
_N = _indices(SENSED, STATE.size + OUTPUT.size)
_D = _indices(DERIVED, STATE.size + OUTPUT.size + SENSED.size)


def _motors(first: int, last: int) -> list[int]:
    able = zip(_D("current_a"), _Y("motor_available_nm"), _D("motor_state"), strict=True)
    return [k for motor in list(able)[first:last] for k in motor]


OF_NODES: dict[str, dict[type[Message], list[int]]] = {
    "DRIVER": {BrakePedal: _N("pedal"), Steering: _N("steering_wheel_rad")},
    "SENSORS": {
        WheelSpeedFront: _N("wheel_speed_rad_s", 0, 2),
        WheelSpeedRear: _N("wheel_speed_rad_s", 2, 4),
        BodyMotion: _N("body_motion"),
    },
    "EHB": {
        EhbPressureFront: _N("pressure_pa", 0, 2) + _D("ehb_state", 0, 1),
        EhbPressureRear: _N("pressure_pa", 2, 4) + _D("ehb_state", 1, 2),
    },
    "IWM": {MotorStatusFront: _motors(0, 2), MotorStatusRear: _motors(2, 4)},
    "BATTERY": {BatteryStatus: _X("state_of_charge") + _Y("charge_power_limit_w")},
}
"""Frames of the car's nodes in the order of sending, and where their values come from."""
TRUTH: dict[type[Message], list[int]] = {
    TruthMotion: _X("speed_mps") + _Y("acceleration_mps2") + _X("distance_m") + _D("manoeuvre"),
    TruthWheelTorque: _Y("wheel_torque_nm"),
    TruthFrictionTorque: _Y("friction_torque_nm"),
    TruthPadFriction: _D("pad_friction"),
    TruthDiscTemperature: _X("disc_temperature_k"),
    TruthLongitudinalForce: _Y("longitudinal_force_n"),
    TruthWheelLoad: _Y("wheel_load_n"),
    TruthEnergy: _X("recuperated_j") + _X("friction_heat_j"),
    PlantReception: _D("demand_counter") + _D("lost") + _D("corrupt"),
}
"""What no car can measure, and which demands this tick was computed from, for the bench."""


@exact_entry
def gather(
    x: Vector, y: Vector, switch: Vector, p: Vector, sensed: Vector, derived: Vector, sources: NDArray[np.int64],
    values: Vector,
) -> None:  # fmt: skip
    """Derive what follows from the measured, and put the values of all messages side by side.

    Parameters
    ----------
    x, y, switch, p, sensed : vectors ``STATE``, ``OUTPUT``, ``SWITCH``, ``PARAMETER``, ``SENSED``.
    derived : vector ``DERIVED``, its first part written.
    sources : place of each value, as in `OF_NODES`.  values : written.
    """
    for i in range(4):
        derived[D.current_a + i] = sensed[N.motor_nm + i] / p[P.motor_torque_constant_nm_a]
        running = _OK if y[Y.motor_derating + i] >= 1.0 else _DERATED
        derived[D.motor_state + i] = _FAILED if switch[S.motor_alive + i] == 0.0 else running
        derived[D.pad_friction + i] = x[X.pad_friction + i] * switch[S.pad_friction + i]
    measured = x.size + y.size
    for k in range(sources.size):
        place = sources[k]
        if place < x.size:
            values[k] = x[place]
        elif place < measured:
            values[k] = y[place - x.size]
        elif place < measured + sensed.size:
            values[k] = sensed[place - measured]
        else:
            values[k] = derived[place - measured - sensed.size]


class Reports:
    """The frames of the played nodes, and the truth.

    Parameters
    ----------
    play : nodes of brake.dbc whose frames are sent.
    p : vector ``PARAMETER``.
    """

    def __init__(self, play: frozenset[str], p: Vector) -> None:
        messages = {kind: places for node, of in OF_NODES.items() if node in play for kind, places in of.items()}
        messages |= TRUTH
        for kind, places in messages.items():
            assert len(places) == len(spec_of(kind).fields), kind
        self._batch = Batch(messages)
        self._sources = np.array([place for places in messages.values() for place in places], np.int64)
        self._derived = DERIVED.zeros()
        self._set_by_nodes = writer(self._derived, D.ehb_state)
        self._p = p

    def frames(
        self, now_ns: int, x: Vector, y: Vector, switch: Vector, sensed: Vector, brakes: list[EhbState],
        manoeuvre: ManoeuvreState, receiver: Receiver,
    ) -> list[Frame]:  # fmt: skip
        """Frames of this tick.

        Parameters
        ----------
        x, y, switch, sensed : vectors ``STATE``, ``OUTPUT``, ``SWITCH``, ``SENSED``.
        brakes : what each axle follows.  manoeuvre : where it is.  receiver : of the demands first.
        """
        counters = receiver.counters[: len(DEMANDS)]
        self._set_by_nodes(*brakes, manoeuvre, *counters, receiver.lost, receiver.corrupt)
        gather(x, y, switch, self._p, sensed, self._derived, self._sources, self._batch.values)
        return self._batch.frames(now_ns)

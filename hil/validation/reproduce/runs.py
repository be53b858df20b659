"""One closed-loop run in virtual time, as arrays: truth, what was demanded, what the controller estimated."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from dbc.bench_messages import (
    FaultCommand,
    ManoeuvreState,
    PhysicalFault,
    StimulusEcu,
    TruthDiscTemperature,
    TruthEnergy,
    TruthFrictionTorque,
    TruthLongitudinalForce,
    TruthMotion,
    TruthPadFriction,
    TruthWheelTorque,
)
from dbc.contract import spec_of
from dbc.exchange import Transmitter
from dbc.frame import Frame, Received
from dbc.messages import EhbPressureFront, EhbPressureRear
from ecu.node import EcuNode
from ecu.parameters.ecu import EcuParameters
from hil.rt.lockstep import Member, lockstep
from hil.scenario.effects import NONE, Effects
from hil.scenario.parameters import load_set
from plant.manoeuvre import Manoeuvre
from plant.node import PlantNode
from plant.parameters.plant import PlantParameters

Vector = NDArray[np.float64]
TICK_NS = 10_000_000
_RECORDED = (
    TruthMotion,
    TruthWheelTorque,
    TruthFrictionTorque,
    TruthPadFriction,
    EhbPressureFront,
    EhbPressureRear,
    TruthLongitudinalForce,
    TruthDiscTemperature,
    TruthEnergy,
)


@dataclass(frozen=True)
class Fault:
    """A physical fault of the vehicle: what, on which wheels (bit per wheel), when after the manoeuvre's start."""

    kind: PhysicalFault
    wheels: int
    at_s: float


@dataclass(frozen=True)
class Run:
    """Samples at the sensors' times, 100 Hz; time 0 is the manoeuvre's start; wheels fl, fr, rl, rr.

    Estimates stand at the time of the sensor samples that they were computed from.
    """

    time_s: Vector
    speed_mps: Vector
    acceleration_mps2: Vector
    wheel_torque_nm: Vector
    friction_torque_nm: Vector
    pad_friction: Vector
    pressure_pa: Vector
    force_n: Vector
    disc_temperature_k: Vector
    recuperated_j: Vector
    friction_heat_j: Vector
    demanded_mps2: Vector
    motor_demand_nm: Vector
    pressure_demand_pa: Vector
    estimated_torque_nm: Vector
    estimated_friction: Vector
    confidence: Vector
    used_friction: Vector
    estimated_speed_mps: Vector
    observer: Vector
    mode: Vector


class _Stimulus:
    """Sends the blending factor, and each fault once."""

    def __init__(self, blending: float, plant: PlantNode, faults: tuple[Fault, ...]) -> None:
        self._blending, self._plant, self._waiting = blending, plant, list(faults)
        self._transmitter = Transmitter()

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        out: list[tuple[object, ...]] = [StimulusEcu(self._blending)]
        if now_ns < 2 * TICK_NS:  # the receiver wants a sequence before it believes a command
            out.append(FaultCommand(PhysicalFault.NONE, 0, 0))
        start = self._plant.manoeuvre_start_ns
        if start is not None:
            for fault in [f for f in self._waiting if now_ns - start >= f.at_s * 1e9]:
                self._waiting.remove(fault)
                out.append(FaultCommand(fault.kind, 1, fault.wheels))
        return self._transmitter.frames(now_ns, out)


def ecu_parameters() -> EcuParameters:
    """The controller's default set."""
    return load_set(resources.files("ecu.parameters") / "paper_ecu.toml", EcuParameters)


def plant_parameters() -> PlantParameters:
    """The paper's car."""
    return load_set(resources.files("plant.parameters") / "paper_car.toml", PlantParameters)


class _Samples:
    """Samples of a run as they come: what the plant said, and what the controller made of it."""

    def __init__(self) -> None:
        self._specs = {(s.bus, s.can_id): (k, s.decode) for k, s in enumerate(map(spec_of, _RECORDED))}
        self._times_ns: list[int] = []
        self._truth: list[list[float]] = []
        self._estimates: list[list[float]] = []
        self._observer: list[Vector] = []

    def add_truth(self, time_ns: int, frames: Sequence[Frame]) -> None:
        """Keep what the plant's frames hold, in the order of `_RECORDED`."""
        row: list[list[float]] = [[] for _ in _RECORDED]
        for frame in frames:
            spec = self._specs.get((frame.bus, frame.can_id))
            if spec is not None:
                k, decode = spec
                row[k] = [float("nan") if v is None else float(v) for v in decode(frame.data)]
        self._truth.append([v for part in row for v in part])
        self._times_ns.append(time_ns)

    def add_estimates(self, controller: EcuNode) -> None:
        """Keep what the controller demands and estimates after its step."""
        m, o = controller.memory, controller.outputs
        assert o is not None  # stepped just now
        e = m.estimates
        self._estimates.append(
            [
                o.demanded_deceleration_mps2,
                *o.motor_demand_nm,
                *o.pressure_demand_pa,
                *e.wheel_torque_nm,
                *e.pad_friction,
                *e.confidence,
                *m.friction,
                e.speed_mps,
                float(o.mode),
            ]
        )
        self._observer.append(m.observer)

    def as_run(self) -> Run:
        """The samples that both have, as arrays."""
        n = min(len(self._truth), len(self._estimates))
        t, e = np.array(self._truth[:n]), np.array(self._estimates[:n])
        return Run(
            time_s=np.array(self._times_ns[:n]) * 1e-9,
            speed_mps=t[:, 0],
            acceleration_mps2=t[:, 1],
            wheel_torque_nm=t[:, 4:8],
            friction_torque_nm=t[:, 8:12],
            pad_friction=t[:, 12:16],
            pressure_pa=t[:, [16, 17, 19, 20]],
            force_n=t[:, 22:26],
            disc_temperature_k=t[:, 26:30],
            recuperated_j=t[:, 30],
            friction_heat_j=t[:, 31],
            demanded_mps2=e[:, 0],
            motor_demand_nm=e[:, 1:5],
            pressure_demand_pa=e[:, 5:9],
            estimated_torque_nm=e[:, 9:13],
            estimated_friction=e[:, 13:17],
            confidence=e[:, 17:21],
            used_friction=e[:, 21:25],
            estimated_speed_mps=e[:, 25],
            observer=np.array(self._observer[:n]),
            mode=e[:, 26],
        )


def drive(
    manoeuvre: Manoeuvre,
    plant: PlantParameters,
    ecu: EcuParameters,
    seed: int,
    blending: float = 0.0,
    faults: tuple[Fault, ...] = (),
    effects: Effects = NONE,
) -> Run:
    """Drive one manoeuvre to its end and return its samples.

    Parameters
    ----------
    plant, ecu : parameter sets of the two nodes.  seed : of the sensors' noise.
    blending : factor alpha set on the bench bus.  effects : what the car has that its set does not state.
    """
    vehicle, controller = PlantNode(plant, manoeuvre, seed, **effects.for_node()), EcuNode(ecu)
    members = [
        Member(vehicle, TICK_NS),
        Member(controller, TICK_NS),
        Member(_Stimulus(blending, vehicle, faults), TICK_NS),
    ]
    samples = _Samples()
    for step in lockstep(members):
        start_ns = vehicle.manoeuvre_start_ns
        if start_ns is None:
            continue
        if step.member == 0:
            if vehicle.state is ManoeuvreState.FINISHED:
                break
            samples.add_truth(step.now_ns - start_ns, step.frames)
        elif step.member == 1 and step.now_ns > start_ns:
            samples.add_estimates(controller)
    return samples.as_run()

"""Excitation: what happens in a segment (brakes, motors, steering, motion) that lets a parameter show.

Takes two parameter sets, gives the excitation that a segment needs for them to differ; the others need not be simulated
(`hil.diagnosis.simulation.simulator.Simulator.with_baseline`). What each parameter and effect needs is declared in the
plant (`plant.excitation`, `plant.effects.effect.Effect.acts_when`).
"""

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import STRAIGHT_RAD
from plant.excitation import AT_POINT, Excitation, of_parameter
from plant.inject import J
from plant.injection.theta import THETA
from plant.injection_points import field
from plant.vectors import INPUT, PARAMETER

_LEAST_PA, _LEAST_NM, _LEAST_MPS2, _LEAST_MPS = 5e4, 8.0, 0.3, 0.3
"""A segment that stays below has no excitation of brakes (Pa), motors (N m), turning (m/s^2) or motion (m/s): what they
change there is below noise. A standing car that no motor pulls shows nothing of tyres, wheels, springs and masses."""
OF_LATENCY = (
    Excitation.NONE,
    Excitation.BRAKES,
    Excitation.MOTORS,
    Excitation.BRAKES,
    Excitation.MOTORS,
    Excitation.TURNING,
    Excitation.TURNING,
    Excitation.NONE,
)
"""For the latency of each node (`hil.diagnosis.vehicle.latency.LATENCY_NODES`)."""


def _of_parameters() -> NDArray[np.int64]:
    needed = np.zeros(PARAMETER.size, np.int64)
    for name in PARAMETER.sizes:
        needed[PARAMETER.slice(name)] = of_parameter(name)
    return needed


def _of_theta() -> NDArray[np.int64]:
    needed = np.full(THETA.size, int(Excitation.ALWAYS), np.int64)
    for effect in THETA.effects:
        for parameter in effect.strengths:
            needed[THETA.slice(effect.name, parameter.name)] = effect.acts_when
    return needed


_PARAMETER, _THETA = _of_parameters(), _of_theta()
_TERM = {int(getattr(J, field(point))): needed for point, needed in AT_POINT.items()}


def of_parameters(one: Floats, other: Floats) -> Excitation:
    """Excitation for two vectors of vehicle parameters, (PARAMETER.size,), to differ."""
    return Excitation(int(np.bitwise_or.reduce(_PARAMETER[one != other], initial=0)))


def of_effects(one: Floats, other: Floats) -> Excitation:
    """Excitation for two vectors of effect parameters, (THETA.size,), to differ."""
    return Excitation(int(np.bitwise_or.reduce(_THETA[one != other], initial=0)))


def of_terms(one: Floats, other: Floats) -> Excitation:
    """Excitation for two banks of nonparametric terms to differ, one of which has a few rows more."""
    more, fewer = (one, other) if len(one) >= len(other) else (other, one)
    if not np.array_equal(more[: len(fewer)], fewer):
        return Excitation.ALWAYS
    needed = Excitation.NONE
    for row in more[len(fewer) :]:
        needed |= _TERM.get(int(row[0]), Excitation.ALWAYS)
    return needed


def excitation_of(inputs: Floats, speed_mps: Floats, ay_mps2: Floats | None) -> Excitation:
    """Excitation of a segment: inputs (rows, INPUT.size), speed and lateral acceleration (samples,), where measured."""

    def most(*parts: str) -> float:
        return max(float(np.abs(inputs[:, INPUT.slice(part)]).max(initial=0.0)) for part in parts)

    present = Excitation.ALWAYS
    if most("pressure_pa", "pressure_demand_pa") > _LEAST_PA:
        present |= Excitation.BRAKES
    if most("motor_torque_nm", "motor_demand_nm") > _LEAST_NM:
        present |= Excitation.MOTORS | Excitation.MOVING
    if float(np.abs(speed_mps).max(initial=0.0)) > _LEAST_MPS:
        present |= Excitation.MOVING
    turns = ay_mps2 is not None and float(np.nanquantile(np.abs(ay_mps2), 0.9)) > _LEAST_MPS2
    if turns or most("steering_wheel_rad") > STRAIGHT_RAD:
        present |= Excitation.TURNING
    return present


def segment_excitations(recording: Recording) -> tuple[Excitation, ...]:
    """Excitation of each segment of a recording."""
    ay, stride = recording.measured.get("ay"), recording.stride
    excitations = []
    for segment in recording.segments:
        samples = slice(segment.first // stride, segment.last // stride)
        inputs, speed_mps = recording.inputs[segment.first : segment.last], recording.speed_mps[samples]
        excitations.append(excitation_of(inputs, speed_mps, None if ay is None else ay[samples]))
    return tuple(excitations)

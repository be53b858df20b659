"""Initial states of the plant: at the start of a recording, and of each segment after the first.

Takes the vehicle, a recording and a parameter set; gives states, (STATE.size,), and speeds, m/s.
"""

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Recording, Segment
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.sensors import ground_speed_before, wheel_speed_before
from hil.diagnosis.vehicle.spec import Vehicle
from plant.friction import mu_equilibrium
from plant.injection.theta import THETA
from plant.model import initial_state
from plant.vectors import DELAY_SLOTS, INPUT, STATE, P, X

DISC_K = 350.0
_BACKWARD_MPS = 0.5
_STEADY = int(0.1 / ROW_S)
"""Rows at the start whose pressures are averaged for the first one."""


def initial_state_of(vehicle: Vehicle, recording: Recording, parameters: ParameterSet, inputs: Floats) -> Floats:
    """State at the first row of the inputs, (rows, INPUT.size), which are without what sensors add.

    The first demand holds since before the log: a log may begin on the brakes.
    """
    disc = (recording.log.disc_temperature_k or DISC_K) + parameters.disc_offset_k
    pad_k = disc if vehicle.pad_temperature_matters else float(parameters.p[P.friction_brake_ambient_k])
    pad = (float(parameters.p[at]) for at in (P.pad_a_1_ks, P.pad_b_1_j, P.pad_epsilon_w))
    x = initial_state(vehicle.parameters, 0.0, disc, recording.state_of_charge, mu_equilibrium(0.0, pad_k, *pad))
    x[STATE.slice("pad_temperature_k")] = pad_k
    speed = start_speed(recording, recording.segments[0], parameters)
    x[X.speed_mps] = speed
    x[STATE.slice("wheel_speed_rad_s")] = speed / _radius_m(parameters)
    x[STATE.slice("pressure_pa")] = np.clip(_first_pressures(inputs), 0.0, None)
    x[STATE.slice("motor_torque_nm")] = inputs[0, INPUT.slice("motor_torque_nm")]
    x[STATE.slice("delayed_demand_pa")] = np.repeat(inputs[0, INPUT.slice("pressure_demand_pa")], DELAY_SLOTS)
    return x


def _first_pressures(inputs: Floats) -> Floats:
    """Measured pressures at the first row, Pa, (4,): a straight line through those before the demand changes."""
    measured, demand = (inputs[:_STEADY, INPUT.slice(name)] for name in ("pressure_pa", "pressure_demand_pa"))
    changed = np.flatnonzero((demand != demand[0]).any(axis=1))
    measured = measured[: changed[0] if len(changed) else len(measured)]
    if len(measured) < 3:
        return np.asarray(measured[0])
    rows = np.arange(len(measured)) - 0.5 * (len(measured) - 1)
    return np.asarray(measured.mean(axis=0) + rows[0] * (rows @ measured) / float(rows @ rows))


def start_speed(recording: Recording, segment: Segment, parameters: ParameterSet) -> float:
    """Speed a segment starts with, m/s: the measured one without what the parameter set's sensors add."""
    if segment.start_speed_mps is not None:
        return _moving(ground_speed_before(segment.start_speed_mps, parameters.theta_in(recording)))
    middle_rad_s = wheel_speed_before(segment.start_wheel_rad_s, parameters.theta_in(recording))
    radii = sorted(_radius_m(parameters).tolist())
    return _moving(middle_rad_s * 0.5 * (radii[1] + radii[2]))


def restart_segment(x: Floats, speed_mps: float) -> None:
    """Set a state, in place, to a measured speed with the slips as they are; all but the lateral motion goes on."""
    now = x[X.speed_mps]
    wheels = STATE.slice("wheel_speed_rad_s")
    if not np.isfinite(x).all():
        x[~np.isfinite(x)] = 0.0
    rolls = abs(now) > 0.5
    ratio = speed_mps / now if rolls else 1.0
    x[wheels] *= ratio
    if not rolls:
        x[wheels] += (speed_mps - now) / 0.3
    if abs(speed_mps) < 0.1:
        x[wheels] = 0.0
    x[X.speed_mps] = speed_mps
    for name in ("lateral_speed_mps", "yaw_rate_rad_s"):
        x[STATE.slice(name)] *= ratio if rolls else 0.0


def _radius_m(parameters: ParameterSet) -> Floats:
    """Rolling radius of each wheel, (4,), effects that change it included: no slip at the start that nobody drove."""
    worn = 1.0 + parameters.theta[THETA.slice("tyre_radius", "gain")]
    flat = 1.0 - 0.01 * parameters.theta[THETA.slice("tyre_pressure_loss", "share")]
    return np.asarray(float(parameters.p[P.wheel_rolling_radius_m]) * worn * flat)


def _moving(speed_mps: float) -> float:
    """A measured speed; a little backward is a car at rest."""
    return 0.0 if -_BACKWARD_MPS < speed_mps < 0.0 else speed_mps

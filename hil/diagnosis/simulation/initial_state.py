"""The state a free replay starts with: at the beginning of a drive, and of each segment after the first."""

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
"""Rows that tell what a pressure was at the first one."""


def initial_state_of(vehicle: Vehicle, drive: Recording, world: ParameterSet, given: Floats) -> Floats:
    """State at the first row of the inputs ``given``, (rows, INPUT.size), what the sensors add taken off.

    What is asked at first has been asked before: a log may begin on the brakes.
    """
    disc = (drive.log.disc_temperature_k or DISC_K) + world.disc_offset_k
    pad_k = disc if vehicle.pad_temperature_matters else float(world.p[P.friction_brake_ambient_k])
    pad = (float(world.p[at]) for at in (P.pad_a_1_ks, P.pad_b_1_j, P.pad_epsilon_w))
    x = initial_state(vehicle.parameters, 0.0, disc, drive.state_of_charge, mu_equilibrium(0.0, pad_k, *pad))
    x[STATE.slice("pad_temperature_k")] = pad_k
    speed = start_speed(drive, drive.segments[0], world)
    x[X.speed_mps] = speed
    x[STATE.slice("wheel_speed_rad_s")] = speed / _radius_m(world)
    x[STATE.slice("pressure_pa")] = np.clip(_first_pressures(given), 0.0, None)
    x[STATE.slice("motor_torque_nm")] = given[0, INPUT.slice("motor_torque_nm")]
    x[STATE.slice("delayed_demand_pa")] = np.repeat(given[0, INPUT.slice("pressure_demand_pa")], DELAY_SLOTS)
    return x


def _first_pressures(given: Floats) -> Floats:
    """Measured pressures at the first row, Pa, (4,): a straight line through those before others are asked for."""
    told, asked = (given[:_STEADY, INPUT.slice(name)] for name in ("pressure_pa", "pressure_demand_pa"))
    others = np.flatnonzero((asked != asked[0]).any(axis=1))
    told = told[: others[0] if len(others) else len(told)]
    if len(told) < 3:
        return np.asarray(told[0])
    rows = np.arange(len(told)) - 0.5 * (len(told) - 1)
    return np.asarray(told.mean(axis=0) + rows[0] * (rows @ told) / float(rows @ rows))


def start_speed(drive: Recording, segment: Segment, world: ParameterSet) -> float:
    """Speed a segment starts with: what the sensors told, less what the world's sensors add."""
    if segment.start_speed_mps is not None:
        return _moving(ground_speed_before(segment.start_speed_mps, world.theta_in(drive)))
    told = wheel_speed_before(segment.start_wheel_rad_s, world.theta_in(drive))
    radii = sorted(_radius_m(world).tolist())
    return _moving(told * 0.5 * (radii[1] + radii[2]))


def restart_segment(x: Floats, speed_mps: float) -> None:
    """The measured speed with the slips as they are; temperatures, friction, energy and pitch go on."""
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


def _radius_m(world: ParameterSet) -> Floats:
    """Rolling radius of each wheel, (4,), effects that change it included: no slip at the start that nobody drove."""
    worn = 1.0 + world.theta[THETA.slice("tyre_radius", "gain")]
    flat = 1.0 - 0.01 * world.theta[THETA.slice("tyre_pressure_loss", "share")]
    return np.asarray(float(world.p[P.wheel_rolling_radius_m]) * worn * flat)


def _moving(speed_mps: float) -> float:
    """A measured speed; a little backward is a car at rest."""
    return 0.0 if -_BACKWARD_MPS < speed_mps < 0.0 else speed_mps

"""The vehicle as functions on flat vectors: start, advance (live), replay (batches)."""

from math import floor, pi

import numpy as np
from numpy.typing import NDArray

from plant.compiled import entry, section
from plant.equations import derivative
from plant.friction import mu_equilibrium
from plant.integrate import SEMI_IMPLICIT, WORK_SHAPE, runge_kutta_step, semi_implicit_step
from plant.layout import flatten
from plant.parameters.plant import PlantParameters
from plant.road import DRY, road_table
from plant.vectors import CUT, DELAY_SLOTS, INPUT, OUTPUT, PARAMETER, STATE, SWITCH, P, U, X

Vector = NDArray[np.float64]
STEP_S = 1e-3


def pack(parameters: PlantParameters) -> Vector:
    """Parameter vector (``PARAMETER``)."""
    values = flatten(parameters)
    return np.concatenate([np.asarray(values[name], dtype=np.float64) for name in PARAMETER.sizes])


def healthy() -> Vector:
    """Switches of a car without physical faults (``SWITCH``)."""
    return np.ones(SWITCH.size)


def initial_state(
    parameters: PlantParameters,
    speed_mps: float,
    disc_temperature_k: float,
    state_of_charge: float,
    pad_friction: float | None = None,
) -> Vector:
    """State of a car that rolls straight ahead, brakes released (``STATE``).

    ``pad_friction`` None starts the pads at the rest value of equation (3) for the temperature.
    """
    x = STATE.zeros()
    x[X.speed_mps] = speed_mps
    x[STATE.slice("wheel_speed_rad_s")] = speed_mps / parameters.wheel.rolling_radius_m
    for part in ("disc_temperature_k", "pad_temperature_k"):
        x[STATE.slice(part)] = disc_temperature_k
    pad = parameters.pad
    rest = mu_equilibrium(0.0, disc_temperature_k, pad.a_1_ks, pad.b_1_j, pad.epsilon_w)
    x[STATE.slice("pad_friction")] = rest if pad_friction is None else pad_friction
    x[STATE.slice("winding_temperature_k")] = parameters.friction_brake.ambient_k
    x[X.state_of_charge] = state_of_charge
    return x


@section
def delay_demand(x: Vector, u: Vector, dead_time_s: float, step_s: float, delayed: Vector) -> None:
    """Put the pressure demand into the delay line and write the demand of a dead time ago into ``delayed``."""
    newest = int(x[X.delay_index])
    newest = newest + 1 if newest + 1 < DELAY_SLOTS else 0
    x[X.delay_index] = newest
    back = min(dead_time_s / step_s, DELAY_SLOTS - 2.0)
    whole = int(back)
    part = back - whole
    late, later = (newest - whole) % DELAY_SLOTS, (newest - whole - 1) % DELAY_SLOTS
    for i in range(4):
        line = X.delayed_demand_pa + i * DELAY_SLOTS
        x[line + newest] = u[U.pressure_demand_pa + i]
        delayed[U.pressure_demand_pa + i] = (1.0 - part) * x[line + late] + part * x[line + later]


@section
def count_teeth(x: Vector, before: Vector, step_s: float, pitch_rad: float) -> None:
    """Note the passing of teeth within the step just made: how many, and when the last one."""
    for i in range(4):
        old, new = before[i] / pitch_rad, x[X.wheel_angle_rad + i] / pitch_rad
        passed = floor(new) - floor(old)
        if passed != 0.0:
            edge = floor(new) if new > old else floor(new) + 1.0
            x[X.tooth_time_s + i] = x[X.time_s] - step_s * (new - edge) / (new - old)
            x[X.tooth_count + i] += abs(passed)


@section
def run(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, steps: int,
    method: int, work: Vector, now: Vector, angles: Vector, y: Vector,
) -> None:  # fmt: skip
    """Advance ``x`` in place by ``steps`` steps under constant inputs."""
    for i in range(u.size):
        now[i] = u[i]
    for _ in range(steps):
        delay_demand(x, u, p[P.ehb_dead_time_s], step_s, now)
        for i in range(4):
            angles[i] = x[X.wheel_angle_rad + i]
        if method == SEMI_IMPLICIT:
            semi_implicit_step(x, now, cut, switch, p, road, step_s, y)
        else:
            runge_kutta_step(x, now, cut, switch, p, road, step_s, work, y)
        x[X.time_s] += step_s
        count_teeth(x, angles, step_s, 2.0 * pi / p[P.sensor_teeth])


@entry
def advance(
    x: Vector, u: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, steps: int,
    method: int, y: Vector,
) -> None:  # fmt: skip
    """Advance the state ``x`` in place and write the outputs at its end into ``y``.

    Parameters
    ----------
    x, u, cut, switch, p, y : vectors ``STATE``, ``INPUT``, ``CUT``, ``SWITCH``, ``PARAMETER``, ``OUTPUT``.
    road : rows of `plant.road.road_table`.  step_s : s.  steps : how many; 0 only evaluates the outputs.
    method : `plant.integrate.SEMI_IMPLICIT` or `RUNGE_KUTTA_4`.
    """
    work = np.empty(WORK_SHAPE)
    now = u.copy()
    angles = np.empty(4)
    run(x, u, cut, switch, p, road, step_s, steps, method, work, now, angles, y)
    derivative(x, now, cut, switch, p, road, y)


def compile_model() -> None:
    """Compile the model now, or load it from disk; else the first call does."""
    x, y = STATE.zeros(), OUTPUT.zeros()
    x[X.delay_index] = 0.0
    advance(x, INPUT.zeros(), CUT.zeros(), healthy(), np.ones(PARAMETER.size), road_table(DRY), STEP_S, 0, 0, y)

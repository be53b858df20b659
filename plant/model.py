"""The vehicle as functions on flat vectors: start, advance (live), replay (measured inputs, batches).

`simulate` is the compiled kernel, flat on purpose: a compiler passes no values of other kinds. `advance` and `replay`
are its faces for Python.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from math import floor, pi

import numpy as np
from numpy.typing import NDArray

from plant.compiled import borrowing_entry, section
from plant.equations import derivative, sensed
from plant.friction import mu_equilibrium
from plant.injection import apply
from plant.injection.bank import NO_TERMS
from plant.injection.plugin import NO_PLUGINS
from plant.injection.theta import THETA
from plant.integrate import (
    EXPONENTIAL,
    SEMI_IMPLICIT,
    WORK_SHAPE,
    exponential_step,
    runge_kutta_step,
    semi_implicit_step,
)
from plant.layout import flatten
from plant.parameters.plant import PlantParameters
from plant.road import DRY, road_table
from plant.rolling import CREEPING_S, long_step_valid, rolling_step
from plant.vectors import CUT, DELAY_SLOTS, INPUT, OUTPUT, PARAMETER, STATE, SWITCH, P, U, X

Vector = NDArray[np.float64]
STEP_S = 1e-3
_NOTHING = np.empty(0, dtype=np.int64)
_NO_ROWS = np.empty((1, 0))
_ONE_BY_ONE = np.ones(1, dtype=np.int64)
NEUTRAL = THETA.neutral()
_NOW, _Q, _ANGLES = WORK_SHAPE[0], WORK_SHAPE[0] + 1, WORK_SHAPE[0] + 2  # rows of the scratch, behind the steps' own
_SCRATCH_SHAPE = (WORK_SHAPE[0] + 3, max(WORK_SHAPE[1], apply.SIZE, INPUT.size))


def pack(parameters: PlantParameters) -> Vector:
    """Parameter vector (``PARAMETER``)."""
    values = flatten(parameters)
    return np.concatenate([np.asarray(values[name], dtype=np.float64) for name in PARAMETER.sizes])


def healthy() -> Vector:
    """Switches of a car without physical faults (``SWITCH``)."""
    return np.ones(SWITCH.size)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What stays as it is while a car is driven: where measured values enter, faults, road, what is injected.

    Attributes
    ----------
    cut, switch : vectors ``CUT`` and ``SWITCH``; nothing measured and no fault by default.
    road : rows of `plant.road.road_table`, dry and flat by default.
    theta : numbers of all effects (`plant.injection.theta`), neutral by default; in `replay` also one row a car.
    terms, plugins : tables of `plant.injection.bank` and `plant.injection.plugin`.
    """

    cut: Vector = field(default_factory=CUT.zeros)
    switch: Vector = field(default_factory=healthy)
    road: Vector = field(default_factory=lambda: road_table(DRY))
    theta: Vector = field(default_factory=lambda: NEUTRAL)
    terms: Vector = field(default_factory=lambda: NO_TERMS)
    plugins: Vector = field(default_factory=lambda: NO_PLUGINS)


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
def delay_demand(x: Vector, u: Vector, dead_time_s: float, step_s: float, at_once: int, delayed: Vector) -> None:
    """Put the pressure demand into the delay line and write the demand of a dead time ago into ``delayed``.

    For so many steps ``at_once``: the mean over them.
    """
    back = min(dead_time_s / step_s, DELAY_SLOTS - 2.0)
    whole = int(back)
    part = back - whole
    newest = int(x[X.delay_index])
    for i in range(4):
        delayed[U.pressure_demand_pa + i] = 0.0
    for _ in range(at_once):
        newest = newest + 1 if newest + 1 < DELAY_SLOTS else 0
        late = newest - whole if newest >= whole else newest - whole + DELAY_SLOTS
        later = late - 1 if late > 0 else DELAY_SLOTS - 1
        for i in range(4):
            line = X.delayed_demand_pa + i * DELAY_SLOTS
            x[line + newest] = u[U.pressure_demand_pa + i]
            delayed[U.pressure_demand_pa + i] += ((1.0 - part) * x[line + late] + part * x[line + later]) / at_once
    x[X.delay_index] = newest


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


@borrowing_entry
def _simulate(
    x: Vector, inputs: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, steps: int,
    at_once: NDArray[np.int64], method: int, columns: NDArray[np.int64], table: Vector, y: Vector, theta: Vector,
    terms: Vector, plugins: Vector, scratch: Vector,
) -> None:  # fmt: skip
    """As `simulate`, with a ``scratch`` of shape `_SCRATCH_SHAPE` that this may overwrite."""
    work = scratch[: WORK_SHAPE[0]]
    now, q, angles = scratch[_NOW, : inputs.shape[1]], scratch[_Q, : apply.SIZE], scratch[_ANGLES, :4]
    rows = at_once.shape[0]
    notes_outputs = False
    for k in range(columns.size):
        notes_outputs |= columns[k] >= x.size
    apply.begin(p, theta, terms, plugins, q, y, work[2])
    for row in range(rows):
        now_s = x[X.time_s]
        apply.row(x, now, p, theta, now_s, now_s + max(steps, 1) * step_s, q, y, work[2])
        following = min(row + 1, inputs.shape[0] - 1)
        for i in range(now.size):
            now[i] = inputs[row, i]
        if columns.size > 0:
            if notes_outputs:
                derivative(x, now, cut, switch, q, road, y)
                sensed(x, y)
            for k in range(columns.size):
                table[row, k] = x[columns[k]] if columns[k] < x.size else y[columns[k] - x.size]
        step = 0
        while step < steps:
            together = min(at_once[row], steps - step)
            long_s = together * step_s
            share, width = (step + 0.5 * together) / steps, together / steps
            for i in range(U.steering_wheel_rad, now.size):
                now[i] = inputs[row, i] + share * (inputs[following, i] - inputs[row, i])
            for i in range(4):  # mean of the parabola over the step
                bend = 4.0 * (share * (1.0 - share) - width * width / 12.0)
                now[U.motor_torque_nm + i] += bend * inputs[row, U.motor_torque_bend_nm + i]
            delay_demand(x, inputs[row], q[P.ehb_dead_time_s], step_s, together, now)
            for i in range(4):
                angles[i] = x[X.wheel_angle_rad + i]
            if method == SEMI_IMPLICIT:
                semi_implicit_step(x, now, cut, switch, q, road, long_s, y)
            elif method == EXPONENTIAL:
                if long_step_valid(x, now, q, long_s):
                    rolling_step(x, now, cut, switch, q, road, long_s, work, y)
                else:
                    parts = 2 if long_s > CREEPING_S else 1
                    for _ in range(parts):
                        exponential_step(x, now, cut, switch, q, road, long_s / parts, work, y)
            else:
                runge_kutta_step(x, now, cut, switch, q, road, long_s, work, y)
            x[X.time_s] += long_s
            count_teeth(x, angles, long_s, 2.0 * pi / p[P.sensor_teeth])
            step += together
    derivative(x, now, cut, switch, q, road, y)
    sensed(x, y)


def simulate(
    x: Vector, inputs: Vector, cut: Vector, switch: Vector, p: Vector, road: Vector, step_s: float, steps: int,
    at_once: NDArray[np.int64], method: int, columns: NDArray[np.int64], table: Vector, y: Vector, theta: Vector,
    terms: Vector, plugins: Vector,
) -> None:  # fmt: skip
    """Run the car through rows of inputs; the only way into compiled code.

    Parameters
    ----------
    x : state (``STATE``), advanced in place.  inputs : one ``INPUT`` a row, each ``steps`` steps long. Demands hold
        within a row; steering and measured values go linearly towards the next row, torque of the motors by what
        ``motor_torque_bend_nm`` in its middle adds to that in a parabola.
    cut, switch, p : vectors ``CUT``, ``SWITCH``, ``PARAMETER``.  road : rows of `plant.road.road_table`.
    step_s : s.  at_once : how many of its steps each row may make as one, (rows,).
    method : `plant.integrate.SEMI_IMPLICIT`, `RUNGE_KUTTA_4` or `EXPONENTIAL`.
    columns : what to note at the start of each row, as indices into the state followed by the outputs.
    table : the notes, shape (rows, columns), written.  y : outputs (``OUTPUT``) at the end, written.
    theta : numbers of all effects (`plant.injection.theta`); onsets act from row to row.
    terms, plugins : tables of `plant.injection.bank` and `plant.injection.plugin`, a row each.
    """
    _simulate(
        x, inputs, cut, switch, p, road, step_s, steps, at_once, method, columns, table, y, theta, terms, plugins,
        np.empty(_SCRATCH_SHAPE),
    )  # fmt: skip


def advance(
    x: Vector, u: Vector, p: Vector, y: Vector, steps: int, scene: Scene, step_s: float = STEP_S,
    method: int = SEMI_IMPLICIT,
) -> None:  # fmt: skip
    """Advance the state ``x`` in place under constant inputs; ``y`` holds the outputs at its end.

    ``steps`` 0 only evaluates the outputs. The vectors are those of `simulate`, ``u`` one ``INPUT``.
    """
    simulate(
        x, u.reshape(1, -1), scene.cut, scene.switch, p, scene.road, step_s, steps, _ONE_BY_ONE, method, _NOTHING,
        _NO_ROWS, y, scene.theta, scene.terms, scene.plugins,
    )  # fmt: skip


def column_indices(names: Sequence[str]) -> NDArray[np.int64]:
    """Indices for `simulate` of columns by name, e.g. ``wheel_speed_rad_s_fl``.

    Outputs come before states of the same name: the pressure that acts, not the one the model makes. The prefix
    ``state.`` asks for the state.

    Raises
    ------
    KeyError
        A name that neither outputs nor state have.
    """
    states = {name: k for k, name in enumerate(STATE.columns())}
    outputs = {name: STATE.size + k for k, name in enumerate(OUTPUT.columns())}
    known = states | {f"state.{name}": k for name, k in states.items()} | outputs
    unknown = [name for name in names if name not in known]
    if unknown:
        raise KeyError(f"no such column: {', '.join(unknown)}; see STATE.columns() and OUTPUT.columns()")
    return np.array([known[name] for name in names], dtype=np.int64)


def replay(
    start: Vector, inputs: Vector, parameters: Vector, columns: Sequence[str], scene: Scene | None = None, *,
    steps: int = 10, step_s: float = STEP_S, method: int = SEMI_IMPLICIT, workers: int = 1,
) -> Vector:  # fmt: skip
    """Run cars through the same rows of inputs, each with its own parameters and start.

    Parameters
    ----------
    start : one state for all, or one a car, shape (STATE.size,) or (cars, STATE.size).
    inputs : shape (rows, INPUT.size); a row lasts ``steps`` times ``step_s``.
    parameters : shape (PARAMETER.size,) or (cars, PARAMETER.size).
    columns : names as for `column_indices`.
    scene : the same for all, but for theta of shape (cars, THETA.size); as many cars as parameters or theta have rows.
    workers : threads; the cars are shared out among them.

    Returns
    -------
    Values at the start of each row, shape (cars, rows, columns).
    """
    scene = Scene() if scene is None else scene
    number = max(parameters.size // PARAMETER.size, scene.theta.size // THETA.size)
    cars = np.broadcast_to(parameters, (number, PARAMETER.size))
    thetas = np.broadcast_to(scene.theta, (number, THETA.size))
    starts = np.broadcast_to(start, (number, STATE.size))
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    indices, at_once = column_indices(columns), np.ones(len(rows), np.int64)
    table = np.empty((len(cars), len(rows), len(indices)))

    def one(k: int) -> None:  # copies, because for read-only vectors the model would be compiled once more
        simulate(
            starts[k].copy(), rows, scene.cut, scene.switch, cars[k].copy(), scene.road, step_s, steps, at_once, method,
            indices, table[k], OUTPUT.zeros(), thetas[k].copy(), scene.terms, scene.plugins,
        )  # fmt: skip

    if workers == 1:
        for k in range(len(cars)):
            one(k)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(one, range(len(cars))))
    return table


def compile_model() -> None:
    """Compile the model now, or load it from disk; else the first call does."""
    p = np.ones(PARAMETER.size)
    advance(STATE.zeros(), INPUT.zeros(), p, OUTPUT.zeros(), 0, Scene())

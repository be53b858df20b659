"""The plant: against scipy's solver and plain Python on the same right-hand side, batches, and its start.

One braked bend: 90 km/h, 20 bar, -120 N m a wheel, 0.6 rad at the steering wheel, 2 s. scipy runs its default method at
the loosest tolerance whose error is ours.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hil.rt.clock import monotonic_ns
from hil.validation.perf import effects
from hil.validation.perf.row import Progress, Row, paired, time_per_call_ns, unseen
from hil.validation.verify.car import paper_car
from hil.validation.verify.right_hand_side import RightHandSide
from plant.integrate import RUNGE_KUTTA_4, SEMI_IMPLICIT
from plant.model import STEP_S, Scene, advance, initial_state, pack, replay
from plant.parameters import PlantParameters
from plant.vectors import BASE_RATES, INPUT, OUTPUT, RATES

Vector = NDArray[np.float64]
DURATION_S = 2.0
STEPS = round(DURATION_S / STEP_S)
CARS = 64
PAIRS = 5
FIRST_START_LIMIT_S, LATER_START_LIMIT_S = 20.0, 2.0


@cache
def car() -> PlantParameters:
    """The paper's car without the dead time of its brake, which no plain solver knows."""
    return replace(paper_car(), ehb=replace(paper_car().ehb, dead_time_s=0.0))


def bend() -> Vector:
    """Inputs of the bend."""
    u = INPUT.zeros()
    u[INPUT.slice("pressure_demand_pa")] = 20e5
    u[INPUT.slice("motor_demand_nm")] = -120.0
    u[INPUT.slice("steering_wheel_rad")] = 0.6
    return u


def start() -> Vector:
    """State at the start of the bend."""
    return initial_state(car(), 25.0, 423.15, 0.7)


def run(method: int, steps: int = STEPS) -> Vector:
    """State at the end of the bend."""
    x = start()
    advance(x, bend(), pack(car()), OUTPUT.zeros(), steps, Scene(), STEP_S, method)
    return x


def per_step_ns(method: int) -> float:
    """Time of one step in a long call, ns."""
    return time_per_call_ns(lambda: run(method), 20) / STEPS


def reference() -> tuple[Vector, Vector]:
    """Exact state at the end of the bend, and a scale for each state."""
    x0 = start()[: RATES.size]
    result = solve_ivp(
        RightHandSide(car(), bend()), (0.0, DURATION_S), x0, "DOP853", rtol=1e-9,
        atol=1e-9 * np.maximum(np.abs(x0), 1e-2), max_step=5e-3,
    )  # fmt: skip
    return result.y[:, -1], np.maximum(np.abs(result.y).max(axis=1), 1e-3)


def plain(error: float, exact: Vector, scale: Vector) -> dict[str, float]:
    """What the same source does without its compiler."""
    base = slice(BASE_RATES.size)  # without the extra states of effects, which that process has not
    task = {
        "state": start()[base].tolist(), "inputs": bend().tolist(), "parameters": pack(car()).tolist(),
        "duration_s": [DURATION_S], "error": [error], "exact": exact[base].tolist(), "scale": scale[base].tolist(),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "hil.validation.perf.plant_child"], input=json.dumps(task), capture_output=True,
        text=True, check=True, env=os.environ | {"NUMBA_DISABLE_JIT": "1", "BRAKEBENCH_EFFECTS": "0"},
    )  # fmt: skip
    result: dict[str, float] = json.loads(done.stdout)
    return result


def batch_ns(workers: int) -> float:
    """Time per car and step, ns, of `CARS` cars with parameters of their own."""
    rng = np.random.default_rng(1)
    cars = np.tile(pack(car()), (CARS, 1)) * rng.uniform(0.98, 1.02, (CARS, 1))
    rows = np.tile(bend(), (STEPS // 10, 1))

    def batch() -> None:
        replay(start(), rows, cars, ["speed_mps", "pad_friction_fl"], workers=workers)

    return time_per_call_ns(batch, 1) / (CARS * STEPS)


def start_s(folder: str) -> float:
    """Time for a new process to have the model compiled, s, with its cache in ``folder``."""
    began_ns = monotonic_ns()
    subprocess.run(
        [sys.executable, "-c", "from plant.model import compile_model; compile_model()"], check=True,
        env=os.environ | {"NUMBA_CACHE_DIR": folder},
    )  # fmt: skip
    return (monotonic_ns() - began_ns) * 1e-9


def measure(progress: Progress = unseen) -> list[Row]:
    """All rows."""
    exact, scale = reference()
    errors = {m: float(np.abs((run(m)[: RATES.size] - exact) / scale).max()) for m in (SEMI_IMPLICIT, RUNGE_KUTTA_4)}
    rows = []
    for name, method, key in (("semi-implicit", SEMI_IMPLICIT, "semi_ns"), ("RK4", RUNGE_KUTTA_4, "rk4_ns")):
        others, mine = [], []
        for _ in range(3):
            mine.append(per_step_ns(method))
            others.append(plain(errors[method], exact, scale))
        for label, field, what in (
            (
                "solve_ivp",
                "solve_ivp_ns",
                f"RK45, plain Python, rtol {others[0]['tolerance']:g}, error {others[0]['error']:.1e}",
            ),
            ("plain Python", key, "the same source uncompiled, floats in lists"),
        ):
            ratio = statistics.median(o[field] / m for o, m in zip(others, mine, strict=True))
            figure = statistics.median(o[field] for o in others)
            title = f"{name} (error {errors[method]:.1e}) against {label}"
            rows.append(Row(title, statistics.median(mine), figure, what, ratio, "ns/step"))
    rows.append(
        paired("semi-implicit against RK4", lambda: per_step_ns(SEMI_IMPLICIT), lambda: per_step_ns(RUNGE_KUTTA_4),
               "our own RK4", "ns/step", pairs=PAIRS)
    )  # fmt: skip
    for name, method in (("semi-implicit", SEMI_IMPLICIT), ("RK4", RUNGE_KUTTA_4)):
        rows.append(  # mypy infers no type for a default of a lambda, which binds what this turn of the loop has
            paired(f"{name} against the clock", lambda m=method: per_step_ns(m), lambda: STEP_S * 1e9,  # type: ignore[misc]
                   "real time", "ns/step", pairs=PAIRS)
        )  # fmt: skip
    progress(0.5)
    rows += effects.measure(per_step_ns)
    progress(0.7)
    cores = len(os.sched_getaffinity(0))
    rows.append(
        paired(f"{CARS} cars on {cores} cores", lambda: batch_ns(cores), lambda: batch_ns(1), "one core", "ns/step",
               pairs=PAIRS)
    )  # fmt: skip
    rows.append(
        paired(f"{CARS} cars on {cores} cores, against the clock", lambda: batch_ns(cores), lambda: STEP_S * 1e9,
               "real time", "ns/step", pairs=PAIRS)
    )  # fmt: skip
    progress(0.9)
    with tempfile.TemporaryDirectory() as folder:
        first, later = start_s(folder), start_s(folder)
    rows.append(Row("first start, compiles", first, FIRST_START_LIMIT_S, "our limit", FIRST_START_LIMIT_S / first, "s"))
    rows.append(Row("later start", later, LATER_START_LIMIT_S, "our limit", LATER_START_LIMIT_S / later, "s"))
    return rows

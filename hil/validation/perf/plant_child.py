"""The plant without its compiler, in a process of its own: the same source on plain Python floats in lists.

Started by `hil.validation.perf.plant` with NUMBA_DISABLE_JIT=1; reads one JSON object on stdin, prints one on stdout.
"""

import json
import sys

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hil.validation.perf.row import time_per_call_ns
from plant.equations import derivative
from plant.integrate import WORK_SHAPE, runge_kutta_step, semi_implicit_step
from plant.vectors import CUT, OUTPUT, RATES, SWITCH, Y

STEP_S = 1e-3
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7)


class Row(list[float]):
    """A list that knows its size as an array does."""

    @property
    def size(self) -> int:
        """Number of elements."""
        return len(self)


class Road:
    """A flat dry road, read like the road table."""

    shape = (1, 4)

    def __getitem__(self, place: tuple[int, int]) -> float:
        """Element of the table."""
        return (-1e9, 1.0, 1.0, 0.0)[place[1]]


def measure(task: dict[str, list[float]]) -> dict[str, float]:
    """Time of one step of each method, and of scipy's default solver at a given error."""
    x, u, p = Row(task["state"]), Row(task["inputs"]), Row(task["parameters"])
    cut, switch, road, y = Row([0.0] * CUT.size), Row([1.0] * SWITCH.size), Road(), Row([0.0] * OUTPUT.size)
    work = [Row([0.0] * WORK_SHAPE[1]) for _ in range(WORK_SHAPE[0])]
    fixed = (u, cut, switch, p, road)
    semi, rk4 = Row(x), Row(x)
    # lists stand in for vectors here: uncompiled, an element of a list is read much sooner than one of an array
    semi_ns = time_per_call_ns(lambda: semi_implicit_step(semi, *fixed, STEP_S, y), 200)  # type: ignore[arg-type]
    rk4_ns = time_per_call_ns(lambda: runge_kutta_step(rk4, *fixed, STEP_S, work, y), 60)  # type: ignore[arg-type]

    def rates(_: float, state: NDArray[np.float64]) -> list[float]:
        derivative(state.tolist(), *fixed, y)  # type: ignore[arg-type]
        return y[Y.rate : Y.rate + RATES.size]

    (duration_s,), exact, scale = task["duration_s"], np.array(task["exact"]), np.array(task["scale"])
    start = np.array(x[: RATES.size])
    for tolerance in TOLERANCES:
        ends: list[NDArray[np.float64]] = []

        def solve(tolerance: float = tolerance, ends: list[NDArray[np.float64]] = ends) -> None:
            result = solve_ivp(rates, (0.0, duration_s), start, rtol=tolerance, atol=tolerance * scale)
            ends.append(result.y[:, -1])

        took_ns = time_per_call_ns(solve, 1)
        error = float(np.abs((ends[0] - exact) / scale).max())
        if error <= task["error"][0]:
            break
    return {
        "semi_ns": semi_ns, "rk4_ns": rk4_ns, "solve_ivp_ns": took_ns / (duration_s / STEP_S), "error": error,
        "tolerance": tolerance,
    }  # fmt: skip


if __name__ == "__main__":
    json.dump(measure(json.load(sys.stdin)), sys.stdout)

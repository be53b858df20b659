"""The integrators: step halving, and scipy at tight tolerance on the same right-hand side."""

import numpy as np
from scipy.integrate import solve_ivp

from hil.report.report import Chart, Curve, Panel, Section, Trace
from hil.validation.verify.car import drive, inputs, paper_car
from hil.validation.verify.right_hand_side import RightHandSide
from hil.validation.verify.topic import Topic, below
from plant.integrate import RUNGE_KUTTA_4, SEMI_IMPLICIT
from plant.layout import Vector
from plant.model import initial_state
from plant.vectors import INPUT, RATES, X

STEPS_S = (2e-3, 1e-3, 5e-4, 2.5e-4)
METHODS = {"semi-implicit": SEMI_IMPLICIT, "Runge-Kutta 4": RUNGE_KUTTA_4}
STOP = inputs(6.5, {"pressure_demand_pa": 34e5})
BEND = {"pressure_demand_pa": 20e5, "motor_demand_nm": -120.0, "steering_wheel_rad": 0.6}
BEND_S = 2.0
COMPARED = {  # column -> its name in the figure, its place in the state
    "speed_mps": ("speed", X.speed_mps),
    "yaw_rate_rad_s": ("yaw rate", X.yaw_rate_rad_s),
    "wheel_speed_rad_s_fl": ("wheel speed fl", X.wheel_speed_rad_s),
    "pad_friction_fl": ("pad friction fl", X.pad_friction),
    "disc_temperature_k_fl": ("disc temperature fl", X.disc_temperature_k),
}


def stop_distance_m(step_s: float, method: int) -> float:
    """Distance at which the car first stands, braking with 34 bar from 72 km/h."""
    run = drive(STOP, 20.0, ["speed_mps", "x_m"], step_s=step_s, method=method)
    k = int(np.argmax(run["speed_mps"] <= 0.0))
    before, after = run["speed_mps"][k - 1], run["speed_mps"][k]
    share = before / (before - after)
    return float(run["x_m"][k - 1] + share * (run["x_m"][k] - run["x_m"][k - 1]))


def reference(
    duration_s: float, speed_mps: float, values: dict[str, float], dead_time_s: float
) -> tuple[Vector, Vector]:
    """Times and states of a run under constant inputs by scipy's DOP853 at a relative tolerance of 1e-9.

    The dead time of the pressure demand makes two pieces: without demand, then with it.
    """
    u = INPUT.zeros()
    for part, value in values.items():
        u[INPUT.slice(part)] = value
    without = u.copy()
    without[INPUT.slice("pressure_demand_pa")] = 0.0
    state = initial_state(paper_car(), speed_mps, 423.15, 0.7)[: RATES.size]
    times, states = [], []
    for inputs_now, begin, end in ((without, 0.0, dead_time_s), (u, dead_time_s, duration_s)):
        grid = np.arange(np.ceil(begin * 100 - 1e-9), np.ceil(end * 100 - 1e-9)) / 100.0
        scales = np.maximum(np.abs(state), 1e-2)
        result = solve_ivp(
            RightHandSide(paper_car(), inputs_now), (begin, end), state, "DOP853", np.append(grid, end), rtol=1e-9,
            atol=1e-9 * scales, max_step=5e-3,
        )  # fmt: skip
        times.append(grid)
        states.append(result.y[:, :-1])
        state = result.y[:, -1]
    return np.concatenate(times), np.concatenate(states, axis=1)


def topic() -> Topic:
    """Stopping distance over the step; a braked bend against scipy."""
    distances = {name: [stop_distance_m(step, method) for step in STEPS_S] for name, method in METHODS.items()}
    best = distances["Runge-Kutta 4"][-1]
    numbers = [
        below(f"Halved: {name}", 100.0 * (values[1] / values[2] - 1.0), 0.1, "%", "of the stopping distance, 1 ms")
        for name, values in distances.items()
    ]
    numbers.append(
        below(
            "Distance, semi-implicit",
            100.0 * (distances["semi-implicit"][1] / best - 1.0),
            0.1,
            "%",
            "against RK4 0.25 ms",
        )
    )
    times, exact = reference(BEND_S, 25.0, BEND, paper_car().ehb.dead_time_s)
    panels = []
    for name, method in METHODS.items():
        run = drive(inputs(BEND_S, BEND), 25.0, list(COMPARED), method=method)
        worst = 0.0
        traces = []
        for column, (shown, place) in COMPARED.items():
            true = exact[place]
            error = (run[column] - true) / np.abs(true).max()
            worst = max(worst, float(np.abs(error).max()))
            traces.append(Trace(shown, times, 1e6 * np.abs(error)))
        limit = 0.5 if method == SEMI_IMPLICIT else 0.01
        note = f"{name} at 1 ms against scipy, largest error of the largest value"
        numbers.append(below(f"Error, {name}", 100.0 * worst, limit, "%", note))
        panels.append(Panel(f"Error of {name} at 1 ms, of the largest value", "ppm", tuple(traces)))
    chart = Chart(
        "Stopping distance from 72 km/h", "step", "ms", "against the finest", "mm",
        tuple(
            Curve(name, 1e3 * np.array(STEPS_S), 1e3 * (np.array(values) - best))
            for name, values in distances.items()
        ),
    )  # fmt: skip
    text = "Bend: 90 km/h, 20 bar, -120 N m a wheel and 0.6 rad at the steering wheel from the start."
    section = Section("Integrators", tuple(panels), charts=(chart,), text=text)
    return Topic("Integrators", "scipy DOP853 at 1e-9, and themselves at half the step", tuple(numbers), section)

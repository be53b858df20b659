"""Logs that the plant itself made, with sensor noise and a coloured force: short, and the same for several tests."""

from collections.abc import Callable

import numpy as np

from hil.diagnosis.vehicle.load import paper_car
from plant.model import Scene, initial_state, pack, replay
from plant.vectors import INPUT

WHEELS = ("fl", "fr", "rl", "rr")
STEP_S = 0.01
SPEED_MPS = 25.0


def _demands(n: int, k: int) -> np.ndarray:
    """Motor pulses either way, a brake pressure in between."""
    t, u = np.arange(n) * STEP_S, np.zeros((n, INPUT.size))
    u[:, INPUT.slice("motor_demand_nm")] = np.where(t % 4.0 < 1.5, -250.0, np.where(t % 4.0 < 2.5, 200.0, 0.0))[:, None]
    braking = np.clip((t % 6.0 - 3.0 - 0.2 * k) / 0.2, 0.0, 1.0) * (t % 6.0 < 4.5)
    u[:, INPUT.slice("pressure_demand_pa")] = (braking * (1.0e6 + 3e5 * k))[:, None]
    return u


def log(
    theta: np.ndarray, seed: int, k: int, seconds: float = 14.0,
    demands: Callable[[int, int], np.ndarray] = _demands, speed_mps: float = SPEED_MPS,
    exact: bool = False,
):  # fmt: skip
    """One log of the shipped car with sensor noise and a coloured force; ``demands`` by number of rows and of log.

    ``exact`` returns speed and distance, (2, rows), without noise and that force beside it.
    """
    rng, n = np.random.default_rng([seed, k]), round(seconds / STEP_S)
    parameters, u = paper_car().parameters, demands(n, k)
    groups = ("state.wheel_speed_rad_s", "state.pressure_pa", "state.motor_torque_nm")
    names = [f"{g}_{w}" for g in groups for w in WHEELS]
    names += ["state.imu_longitudinal_mps2", "state.speed_mps", "state.distance_m"]
    x = initial_state(parameters, speed_mps, 350.0, 0.7)
    (table,) = replay(x, u, pack(parameters), names, Scene(theta=theta))
    force = np.zeros(n)
    for i in range(1, n):
        force[i] = 0.99 * force[i - 1] + 0.03 * np.sqrt(1.0 - 0.99**2) * rng.standard_normal()
    drift = np.cumsum(force) * STEP_S
    columns = {"t_s": np.arange(n) * STEP_S, "ax_mps2": table[:, 12] + force + 0.02 * rng.standard_normal(n)}
    columns["speed_mps"] = table[:, 13] + drift + 0.03 * rng.standard_normal(n)
    for i, w in enumerate(WHEELS):
        columns[f"wheel_speed_{w}_rad_s"] = (table[:, i] + drift / 0.308) * (1.0 + 0.001 * rng.standard_normal(n))
        columns[f"pressure_{w}_pa"] = table[:, 4 + i] + 1e4 * rng.standard_normal(n)
        columns[f"motor_torque_{w}_nm"] = table[:, 8 + i] + rng.standard_normal(n)
        columns[f"pressure_demand_{w}_pa"] = u[:, INPUT.slice("pressure_demand_pa")][:, i]
        columns[f"motor_torque_demand_{w}_nm"] = u[:, INPUT.slice("motor_demand_nm")][:, i]
    return (columns, table[:, 13:15].T) if exact else columns


def logs(theta: np.ndarray, seed: int) -> list[dict[str, np.ndarray]]:
    """Three logs of 14 s."""
    return [log(theta, seed, k) for k in range(3)]

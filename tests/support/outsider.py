"""A car that somebody else wrote, on one page: no tyre curve, no suspension, nothing of the plant's kind.

Four wheels whose slip follows their torque at once, pressures and motors that lag, a coloured force from outside. The
law of the brakes is handed in, so that it can be one that no list has.
"""

from collections.abc import Callable

import numpy as np

VEHICLE = {
    "mass_kg": 1650.0, "wheelbase_m": 2.72, "cog_to_front_axle_m": 1.3, "rolling_radius_m": 0.318,
    "brake_gain_front_nm_pa": 2.9e-4, "brake_gain_rear_nm_pa": 1.7e-4,
}  # fmt: skip
"""All that is told of it."""
WHEELS = ("fl", "fr", "rl", "rr")
STEP_S, SECONDS = 0.005, 26.0
START_MPS = {"stops": 24.0, "mixed": 30.0, "motors": 20.0, "coast": 33.0}
Law = Callable[[float, np.ndarray], np.ndarray]


def demands(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Pressures and motor torques asked for, (rows, 4) each."""
    n = round(SECONDS / STEP_S)
    t, pressure, motor = np.arange(n) * STEP_S, np.zeros((n, 4)), np.zeros((n, 4))
    share = np.array([1.0, 1.0, 0.8, 0.8])
    if kind == "stops":
        for begin in (2.0, 13.0):
            pressure[(t >= begin) & (t < begin + 2.2)] = rng.uniform(12e5, 40e5) * share
    elif kind == "mixed":
        for k in range(6):
            pressure[(t >= 1.0 + 4 * k) & (t < 2.2 + 4 * k)] = rng.uniform(6e5, 35e5) * share
            motor[(t >= 2.6 + 4 * k) & (t < 4.2 + 4 * k)] = rng.uniform(-250.0, 150.0)
    elif kind == "motors":
        for k in range(8):
            motor[(t >= 1.0 + 3 * k) & (t < 2.5 + 3 * k)] = rng.uniform(-280.0, 300.0)
    return pressure, motor


def drive(kind: str, seed: int, law: Law, drag_nm: tuple[float, ...] = (0.0,) * 4) -> dict[str, np.ndarray]:
    """One log in canonical columns; ``law(speed_mps, pressure_pa)`` gives the share of each brake's nominal torque,
    ``drag_nm`` what it grips with when it is released."""
    rng = np.random.default_rng(seed)
    asked_pa, asked_nm = demands(rng, kind)
    n, v, gust = len(asked_pa), START_MPS[kind], 0.0
    mass, radius = VEHICLE["mass_kg"], VEHICLE["rolling_radius_m"]
    gain = np.array([VEHICLE[f"brake_gain_{axle}_nm_pa"] for axle in ("front", "front", "rear", "rear")])
    p, m, rows = np.zeros(4), np.zeros(4), []
    for k in range(n):
        p = p + STEP_S / 0.03 * (asked_pa[max(k - 2, 0)] - p)
        m = m + STEP_S / 0.012 * (asked_nm[k] - m)
        gust = 0.998 * gust + 0.03 * np.sqrt(1.0 - 0.998**2) * rng.standard_normal()
        moving = v > 0.3
        torque = m - moving * (gain * p * law(v, p) + np.array(drag_nm))
        road = 0.5 * 1.2 * 0.29 * 2.2 * v * v + 0.012 * mass * 9.81
        a = torque.sum() / radius / (mass + 4 * 0.9 / radius**2) - moving * road / mass + gust
        if not moving and a < 0.0:
            a, v = 0.0, max(v - 5.0 * STEP_S, 0.0)
        load = mass * 9.81 / 4 * (1.0 + np.array([-1.0, -1.0, 1.0, 1.0]) * a * 0.55 / 9.81 / 2.72 * 2)
        slip = torque / radius / (20.0 * load)
        rows.append([k * STEP_S, v, a, *(v * (1.0 + slip) / radius), *p, *m])
        v = max(v + a * STEP_S, 0.0)
    table = np.array(rows)[::2]
    noisy = table + np.array([0.0, 0.03, 0.03, *[0.03] * 4, *[1e4] * 4, *[1.0] * 4]) * rng.standard_normal(table.shape)
    names = ["t_s", "speed_mps", "ax_mps2"]
    names += [f"wheel_speed_{w}_rad_s" for w in WHEELS] + [f"pressure_{w}_pa" for w in WHEELS]
    log = dict(zip([*names, *(f"motor_torque_{w}_nm" for w in WHEELS)], noisy.T, strict=True))
    for i, wheel in enumerate(WHEELS):
        log[f"pressure_demand_{wheel}_pa"] = asked_pa[::2, i]
        log[f"motor_torque_demand_{wheel}_nm"] = asked_nm[::2, i]
    log["ay_mps2"] = 0.03 * rng.standard_normal(len(table))
    log["yaw_rate_rad_s"] = 0.002 * rng.standard_normal(len(table))
    return log


def logs(law: Law, first_seed: int = 7) -> list[dict[str, np.ndarray]]:
    """Four drives."""
    return [drive(kind, 10 * k + first_seed, law) for k, kind in enumerate(("stops", "mixed", "motors", "coast"))]

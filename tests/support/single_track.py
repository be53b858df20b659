"""A car of other equations than the plant's: one track, straight on, no springs; and its logs."""

from collections.abc import Callable
from math import exp, tanh

import numpy as np

from hil.diagnosis.data.log import PRESSURE, WHEEL_SPEED, Log, make_log

CAR = {
    "mass_kg": 1540.0, "wheelbase_m": 2.65, "cog_to_front_axle_m": 1.15, "cog_height_m": 0.55,
    "rolling_radius_m": 0.315, "brake_gain_front_nm_pa": 2.6e-4, "brake_gain_rear_nm_pa": 1.2e-4,
    "wheel_inertia_kg_m2": 1.1, "drag_coefficient": 0.31, "frontal_area_m2": 2.0, "air_density_kg_m3": 1.2,
    "rolling_resistance": 0.012, "threshold_pressure_pa": 0.0, "slip_stiffness": 18.0,
}  # fmt: skip
FRICTION, STEP_S, EVERY = 0.95, 2.5e-4, 40
TYRES: dict[str, Callable[[float], float]] = {
    "tanh": tanh,
    "brush": lambda x: 1.0 - max(1.0 - x / 3.0, 0.0) ** 3,
    "exponential": lambda x: 1.0 - exp(-x),
}
"""Force over its peak, by K s / D."""
STOPS = ((30.0, 2e6), (33.0, 3.6e6), (24.0, 1.5e6), (27.0, 4.3e6))


def stop(speed_mps: float, pressure_pa: float, tyre: str, pole_s: float, seed: int, front_share: float = 1.0) -> Log:
    """One stop of half a second of coasting and a step of pressure with a lag of 0.12 s, at 100 Hz with white noise.

    ``pole_s`` : lag of the load transfer, as one pole; 0: none.  ``front_share`` : of the front brakes' torque.
    """
    c, form, rng = CAR, TYRES[tyre], np.random.default_rng(seed)
    mass, radius, inertia = c["mass_kg"], c["rolling_radius_m"], c["wheel_inertia_kg_m2"]
    front = c["cog_to_front_axle_m"]
    static = [0.5 * 9.81 * mass * arm / c["wheelbase_m"] for arm in (c["wheelbase_m"] - front, front)]
    gains = front_share * c["brake_gain_front_nm_pa"], c["brake_gain_rear_nm_pa"]
    drag = 0.5 * c["air_density_kg_m3"] * c["drag_coefficient"] * c["frontal_area_m2"]
    v, wheel, p, moved, rows, k = speed_mps, [speed_mps / radius] * 2, 0.0, 0.0, [], 0
    while v > 1.5:
        loads, forces = (static[0] + moved, static[1] - moved), [0.0, 0.0]
        for i in (0, 1):
            slip = (wheel[i] * radius - v) / v
            x = c["slip_stiffness"] * abs(slip) / FRICTION
            forces[i] = (1.0 if slip > 0.0 else -1.0) * FRICTION * loads[i] * form(x)
        a = (2.0 * sum(forces) - drag * v * v) / mass
        if k % EVERY == 0:
            rows.append((k * STEP_S, v, *wheel, a, p))
        for i in (0, 1):
            resisting = gains[i] * p + radius * (forces[i] + c["rolling_resistance"] * loads[i])
            wheel[i] -= STEP_S * resisting / inertia
        towards = -0.5 * mass * a * c["cog_height_m"] / c["wheelbase_m"]
        moved += (towards - moved) * (STEP_S / pole_s if pole_s else 1.0)
        p += STEP_S / 0.12 * ((pressure_pa if k * STEP_S > 0.5 else 0.0) - p)
        v += STEP_S * a
        k += 1
    t, speed, ahead, behind, a, p = np.array(rows).T
    n = len(t)
    channels = {"ax_mps2": a + 0.05 * rng.normal(size=n), "speed_mps": speed + 0.03 * rng.normal(size=n)}
    channels |= {name: p + 5e3 * rng.normal(size=n) for name in PRESSURE}
    channels |= {
        name: omega + 0.07 * rng.normal(size=n)
        for name, omega in zip(WHEEL_SPEED, (ahead, ahead, behind, behind), strict=True)
    }
    return make_log(f"stop {seed}", t, channels)


def stops(tyre: str = "tanh", pole_s: float = 0.0, first_seed: int = 0, front_share: float = 1.0) -> list[Log]:
    """Four stops of the car with one of the `TYRES`."""
    each = enumerate(STOPS, first_seed)
    return [stop(speed, pressure, tyre, pole_s, seed, front_share) for seed, (speed, pressure) in each]

"""Another car of somebody else's, in one log: no load transfer, no steering, tyres whose stiffness knows no load.

It brakes and pulls by turns; wheels spin up by their own inertia. The law of the brakes is handed in.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

VEHICLE = {
    "mass_kg": 1500.0, "wheelbase_m": 2.6, "cog_to_front_axle_m": 1.2, "rolling_radius_m": 0.30,
    "brake_gain_front_nm_pa": 2.4e-4, "brake_gain_rear_nm_pa": 1.2e-4,
}  # fmt: skip
"""All that is told of it."""
WHEELS = ("fl", "fr", "rl", "rr")
_STEP_S, _SECONDS = 1e-3, 150.0
_DEVIATIONS = np.array([0.0, 0.03, 0.04, *[0.04] * 4, *[1e4] * 4, *[1.0] * 4, *[0.0] * 8])
Law = Callable[[float, float], np.ndarray]


class _Driver:
    """Pulls, brakes and rolls, as the speed and chance have it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.mode, self.until_s = rng, "coast", 2.0
        self.pressure_pa, self.torque_nm = np.zeros(4), np.zeros(4)

    def _go_on(self, mode: str, pressure_pa: np.ndarray, torque_nm: np.ndarray, least_s: float, most_s: float) -> None:
        self.mode, self.pressure_pa, self.torque_nm = mode, pressure_pa, torque_nm
        self.until_s += self.rng.uniform(least_s, most_s)

    def decide(self, t_s: float, v: float) -> None:
        if t_s < self.until_s:
            return
        rng, none = self.rng, np.zeros(4)
        self.until_s = t_s
        if v < 3.0 or (self.mode == "brake" and v < 8.0):
            self._go_on("drive", none, np.full(4, rng.uniform(150, 300)), 4, 7)
        elif self.mode != "brake" and v > 12.0:
            pressure = rng.uniform(8e5, 35e5) * np.array([1.0, 1.0, 0.7, 0.7])
            torque = none if rng.random() < 0.6 else np.full(4, -rng.uniform(50, 150))
            self._go_on("brake", pressure, torque, 1.0, 2.5)
        elif self.mode == "brake":
            self._go_on("coast", none, none, 1, 3)
        else:
            self._go_on("drive", none, np.full(4, rng.uniform(150, 300)), 3, 6)


def log(law: Law, seed: int) -> dict[str, np.ndarray]:
    """Canonical columns; ``law(speed_mps, t_s)`` gives the share of each brake's nominal torque."""
    rng = np.random.default_rng(seed)
    driver, v, p, m = _Driver(rng), 28.0, np.zeros(4), np.zeros(4)
    mass, radius = VEHICLE["mass_kg"], VEHICLE["rolling_radius_m"]
    gain = np.array([VEHICLE[f"brake_gain_{axle}_nm_pa"] for axle in ("front", "front", "rear", "rear")])
    turning, rows = np.full(4, v / radius), []
    for k in range(round(_SECONDS / _STEP_S)):
        t = k * _STEP_S
        driver.decide(t, v)
        p = p + _STEP_S / 0.04 * (driver.pressure_pa - p)
        m = m + _STEP_S / 0.01 * (driver.torque_nm - m)
        force = mass * 9.81 / 4 * 20.0 * (turning * radius - v) / max(v, 1.0)
        turning = turning + _STEP_S * (m - gain * p * law(v, t) * np.sign(turning) - force * radius)
        turning = np.maximum(turning, 0.0)
        a = (force.sum() - 0.5 * 1.2 * 0.65 * v * v - 0.011 * mass * 9.81 * (v > 0.1)) / mass
        v = max(v + _STEP_S * a, 0.0)
        if k % 10 == 0:
            rows.append([t, v, a, *turning, *p, *m, *driver.pressure_pa, *driver.torque_nm])
    table = np.array(rows)
    table = table + _DEVIATIONS * rng.standard_normal(table.shape)
    names = ["t_s", "speed_mps", "ax_mps2"]
    for quantity in ("wheel_speed_{}_rad_s", "pressure_{}_pa", "motor_torque_{}_nm", "pressure_demand_{}_pa",
                     "motor_torque_demand_{}_nm"):  # fmt: skip
        names += [quantity.format(wheel) for wheel in WHEELS]
    return dict(zip(names, table.T, strict=True))


def write(folder: Path, law: Law, seed: int = 1) -> tuple[Path, Path]:
    """The log as CSV, and the car as TOML."""
    columns = log(law, seed)
    csv, car = folder / "log.csv", folder / "car.toml"
    table = np.column_stack(list(columns.values()))
    np.savetxt(csv, table, delimiter=",", header=",".join(columns), comments="", fmt="%.8g")
    car.write_text("".join(f"{key} = {value}\n" for key, value in VEHICLE.items()), encoding="utf-8")
    return csv, car

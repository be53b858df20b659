"""What the car `dead_time` drives: a robot's script, by time alone, so that nothing hidden changes what is demanded."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Points = list[tuple[float, float]]
"""Time (s) and value, straight between them."""
CYCLE_S = 0.01
REAR_PRESSURE = 0.8
HOLD_NM = 34.0  # a wheel, that about holds 20 m/s
NEVER = 1e9


@dataclass(frozen=True)
class Script:
    """One log: pressure at the front wheels (Pa), motor torques at a front and a rear wheel (N m), steering (rad)."""

    name: str
    lasts_s: float
    speed_mps: float
    pressure_pa: Points
    front_nm: Points
    rear_nm: Points
    swing_rad: float = 0.0
    swing_hz: float = 0.0
    bend_rad: float = 0.0

    def pressure_demand(self, t_s: Vector) -> Vector:
        """(n, 4), Pa."""
        front = _at(self.pressure_pa, t_s)
        return np.stack([front, front, REAR_PRESSURE * front, REAR_PRESSURE * front], axis=1)

    def torque_demand(self, t_s: Vector) -> Vector:
        """(n, 4), N m."""
        front, rear = _at(self.front_nm, t_s), _at(self.rear_nm, t_s)
        return np.stack([front, front, rear, rear], axis=1)

    def steer(self, t_s: Vector) -> Vector:
        """(n,), rad at the steering wheel: a slalom, then a bend over the last third."""
        swung = self.swing_rad * np.sin(2.0 * np.pi * self.swing_hz * np.maximum(t_s - 1.0, 0.0))
        fades = np.clip((0.62 * self.lasts_s - t_s) / 0.8, 0.0, 1.0)
        bends = np.clip((t_s - 0.66 * self.lasts_s) / 0.8, 0.0, 1.0)
        return np.asarray(swung * fades + self.bend_rad * bends)


def _at(points: Points, t_s: Vector) -> Vector:
    return np.interp(t_s, [t for t, _ in points], [value for _, value in points])


def scripts(rng: np.random.Generator) -> list[Script]:
    """Six logs, 95 to 130 s in all: three stops, a coast-down, bends, snubs that heat the discs."""
    return [_friction(rng), _motors(rng), _blend(rng), _coast(rng), _bends(rng), _snubs(rng)]


def _friction(rng: np.random.Generator) -> Script:
    first, then = rng.uniform(2.2e6, 3.0e6), rng.uniform(3.2e6, 4.6e6)
    at = rng.uniform(2.8, 3.6)
    pressure = [(0.0, 0.0), (1.5, 0.0), (1.8, first), (at, first), (at + 0.2, then), (NEVER, then)]
    return Script("stop_friction", 12.0, rng.uniform(24.0, 30.0), pressure, [(0.0, 0.0)], [(0.0, 0.0)])


def _motors(rng: np.random.Generator) -> Script:
    speed, front, rear = rng.uniform(17.0, 22.0), rng.uniform(200.0, 280.0), rng.uniform(180.0, 240.0)
    out = 1.2 + (speed - 4.5) / ((front + rear) * 2.0 / 0.335 / 1900.0 + 0.15)
    pressure = [(0.0, 0.0), (out, 0.0), (out + 1.2, 1.1e6), (NEVER, 1.1e6)]
    front_nm, rear_nm = ([(0.0, 0.0), (1.0, 0.0), (1.15, -t), (out, -t), (out + 1.2, 0.0)] for t in (front, rear))
    return Script("stop_motors", out + 6.0, speed, pressure, front_nm, rear_nm)


def _blend(rng: np.random.Generator) -> Script:
    stair = np.cumsum(rng.uniform(0.4e6, 0.8e6, 5))
    pressure: Points = [(0.0, 0.0), (1.0, 0.0)]
    torque: Points = [(0.0, 0.0), (1.0, 0.0)]
    for k, level in enumerate(stair):
        begin = 1.0 + 1.5 * k
        pressure += [(begin + 0.1, float(level)), (begin + 1.5, float(level))]
        strength = -rng.uniform(60.0, 220.0) if k < 4 else 0.0
        torque += [(begin + 0.15, strength), (begin + 1.5, strength)]
    return Script("stop_blend", 16.0, rng.uniform(27.0, 32.0), pressure, torque, [(t, 0.8 * m) for t, m in torque])


def _coast(rng: np.random.Generator) -> Script:
    return Script("coast_down", 21.0, rng.uniform(30.0, 34.0), [(0.0, 0.0)], [(0.0, 0.0)], [(0.0, 0.0)])


def _bends(rng: np.random.Generator) -> Script:
    return Script(
        "bends", 18.0, rng.uniform(17.0, 22.0), [(0.0, 0.0)], [(0.0, HOLD_NM)], [(0.0, HOLD_NM)],
        rng.uniform(0.35, 0.65), rng.uniform(0.25, 0.45), rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.7),
    )  # fmt: skip


def _snubs(rng: np.random.Generator) -> Script:
    pressure: Points = [(0.0, 0.0)]
    torque: Points = [(0.0, 0.0)]
    begin = 0.8
    for _ in range(4):
        level, drives = rng.uniform(3.0e6, 3.6e6), rng.uniform(400.0, 460.0)
        slows = 16.0 / (2.0 * 4.4e-4 * level / 0.335 / 1900.0 * 1.12)
        pressure += [(begin, 0.0), (begin + 0.25, level), (begin + slows, level), (begin + slows + 0.2, 0.0)]
        begin += slows + 0.4
        lasts = 16.0 / (4.0 * drives / 0.335 / 1900.0 - 0.2)
        torque += [(begin, 0.0), (begin + 0.2, drives), (begin + lasts, drives), (begin + lasts + 0.2, 0.0)]
        begin += lasts + 0.5
    return Script("snubs", begin, rng.uniform(28.0, 31.0), pressure, torque, torque)

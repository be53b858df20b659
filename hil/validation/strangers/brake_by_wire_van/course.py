"""What a drive with the van is made of: blended stops, an emergency stop, regeneration and drive, a bend, coasting."""

from dataclasses import dataclass

import numpy as np

from hil.validation.strangers.brake_by_wire_van.motion import ROW_S, G
from hil.validation.strangers.brake_by_wire_van.numbers import MASS_KG, RADIUS_M
from hil.validation.strangers.signals import Vector, slow_noise

LEAD_S, REST_S = 0.4, 1.0
LONGEST_STOP_S = 14.0
GUST_MPS, GUST_S = 0.8, 2.0
HILL_M = (70.0, 160.0, 380.0)
HILL = 0.003
"""Grade of each of the waves, one standard deviation of its size."""
EQUIVALENT_KG = 90.0
"""Turning parts as mass: what the pedals' torque has to slow down besides."""


@dataclass(frozen=True)
class Course:
    """Inputs of one log at steps of 1 ms, lead included (`hil.validation.strangers.brake_by_wire_van.motion.run`)."""

    speed_mps: float
    asked_nm: Vector
    curvature: Vector
    hand_rad: Vector
    wind_mps: Vector
    hill: Vector


def courses(rng: np.random.Generator) -> list[Course]:
    """Four to six logs, 90 to 130 s together, from 30 to 100 km/h."""
    kinds = ["stop", "pulses", "coast", "bend", *rng.choice(["stop", "emergency", "pulses"], int(rng.integers(0, 3)))]
    made = [_log(str(kind), rng) for kind in rng.permutation(kinds)]
    spent = sum(length for _, parts, _, length in made if parts[0][1] != 0.0 or len(parts) > 1)
    coast_s = float(np.clip(rng.uniform(101.0, 120.0) - spent, 12.0, 45.0))
    return [
        _course(speed, parts if len(parts) > 1 else [(coast_s, 0.0)], curvature, rng)
        for speed, parts, curvature, _ in made
    ]


Parts = list[tuple[float, float]]


def _log(kind: str, rng: np.random.Generator) -> tuple[float, Parts, float, float]:
    """Speed m/s, parts (duration s, wanted acceleration m/s2), curvature 1/m, length about s."""
    if kind == "coast":
        return rng.uniform(19.0, 27.0), [(0.0, 0.0)], 0.0, 0.0
    before_s = rng.uniform(2.0, 4.0)
    if kind == "pulses":
        parts: Parts = [(before_s, 0.0)]
        for _ in range(int(rng.integers(3, 5))):
            parts += [(rng.uniform(1.5, 3.0), -rng.uniform(0.4, 1.5)), (rng.uniform(1.0, 2.5), 0.0)]
            parts += [(rng.uniform(1.5, 3.0), rng.uniform(0.4, 1.5)), (rng.uniform(0.8, 2.0), 0.0)]
        return rng.uniform(14.0, 22.0), parts, 0.0, sum(part[0] for part in parts)
    if kind == "bend":
        speed, wanted = rng.uniform(35.0, 52.0) / 3.6, rng.uniform(1.8, 3.0)
        curvature = float(rng.choice([-1.0, 1.0])) * rng.uniform(1.2, 2.5) / speed**2
        return speed, [(before_s + 1.0, 0.0), (LONGEST_STOP_S, -wanted)], curvature, before_s + speed / wanted + 2.0
    wanted = rng.uniform(4.2, 5.4) if kind == "emergency" else rng.uniform(1.6, 3.6)
    speed = rng.uniform(45.0, 100.0) / 3.6
    parts = [(before_s, 0.0)]
    if kind == "stop":
        parts += [(rng.uniform(1.5, 2.5), -rng.uniform(0.6, 1.4)), (rng.uniform(1.0, 2.0), 0.0)]
    left = speed + sum(duration * wanted for duration, wanted in parts) - 0.15 * before_s
    length_s = sum(part[0] for part in parts) + max(left, 1.0) / wanted + REST_S
    return speed, [*parts, (LONGEST_STOP_S, -wanted)], 0.0, length_s


def asked_nm(acceleration_mps2: float) -> float:
    """Torque that the pedals ask for an acceleration; coasting as without pedals."""
    if acceleration_mps2 == 0.0:
        return 0.0
    return (acceleration_mps2 + 0.15) * (MASS_KG + EQUIVALENT_KG) * RADIUS_M


def _course(speed_mps: float, parts: Parts, curvature: float, rng: np.random.Generator) -> Course:
    count = round((LEAD_S + sum(part[0] for part in parts)) / ROW_S)
    t: Vector = np.arange(count, dtype=np.float64) * ROW_S
    times, torques, at = [0.0], [0.0], LEAD_S
    for duration, wanted in parts:
        torque = asked_nm(wanted)
        ramp = rng.uniform(0.15, 0.5) * (0.6 if wanted < -4.0 else 1.0)
        times += [at, at + ramp]
        torques += [torques[-1], torque]
        at += duration
    asked = np.interp(t, times, torques) * (1.0 + slow_noise(rng, count, ROW_S, 0.03, 1.0))
    starts = LEAD_S + rng.uniform(0.2, 0.5)
    bend = np.interp(t, [starts, starts + rng.uniform(0.9, 1.6)], [0.0, curvature])
    hill = np.array([
        rng.normal(0.0, HILL, len(HILL_M)), 2.0 * np.pi / (np.array(HILL_M) * rng.uniform(0.8, 1.25, len(HILL_M))),
        rng.uniform(0.0, 2.0 * np.pi, len(HILL_M)),
    ])  # fmt: skip
    hand = slow_noise(rng, count, ROW_S, 0.015, 0.7)
    return Course(speed_mps, asked, bend, hand, slow_noise(rng, count, ROW_S, GUST_MPS, GUST_S), hill)


def slope_mps2(hills: list[Vector], speed_mps: float) -> tuple[float, float]:
    """Standard deviation (m/s2) and time constant (s) of the weight along the road over some logs."""
    power = float(np.mean([np.sum(hill[0] ** 2) / 2.0 for hill in hills]))
    rate = float(np.mean([np.sum(hill[0] ** 2 * hill[1]) / np.sum(hill[0] ** 2) for hill in hills]))
    return G * power**0.5, 1.0 / (rate * speed_mps)

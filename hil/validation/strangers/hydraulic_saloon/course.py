"""What a drive with the saloon is made of: stops, hard and easy, in two parts, in bends; coast-downs in neutral."""

from dataclasses import dataclass

import numpy as np

from hil.validation.strangers.hydraulic_saloon.brakes import BOOSTER_FORCE_N, BOOSTER_GAIN_PA_N, drum_factor
from hil.validation.strangers.hydraulic_saloon.motion import STEP_S, G
from hil.validation.strangers.hydraulic_saloon.numbers import (
    BRAKE_RADIUS_M,
    EFFICIENCY,
    MASS_KG,
    MU,
    PISTON_M2,
    RADIUS_M,
)
from hil.validation.strangers.signals import Vector, slow_noise

LEAD_S = 0.4
"""Driven before a log begins."""
REST_S = 1.2
LONGEST_STOP_S = 14.0
GUST_MPS, GUST_S = 0.3, 2.5
HILL_M = (90.0, 210.0, 520.0)
HILL = 0.0008
"""Grade of each of the waves, one standard deviation of its size."""


@dataclass(frozen=True)
class Course:
    """Inputs of one log at steps of 1 ms, lead included (`hil.validation.strangers.hydraulic_saloon.motion.run`)."""

    speed_mps: float
    foot_n: Vector
    curvature: Vector
    hand_rad: Vector
    wind_mps: Vector
    hill: Vector
    discs_k: Vector


def courses(rng: np.random.Generator) -> list[Course]:
    """Four to six logs, 90 to 130 s together: stops from 40 to 120 km/h in 3 to 8 s, and two coast-downs."""
    kinds = ["hard", "parts", *rng.choice(["stop", "hard", "bend"], int(rng.integers(1, 3)), p=[0.3, 0.3, 0.4])]
    braked = [_braked(str(kind), rng) for kind in rng.permutation(kinds)]
    spent = sum(length for _, length in braked)
    coast_s = float(np.clip((rng.uniform(102.0, 124.0) - spent) / 2.0, 11.0, 36.0))
    coasts = [_course(rng.uniform(23.0, 34.0), [(coast_s, 0.0)], 0.0, rng) for _ in range(2)]
    found = [course for course, _ in braked]
    for coast in coasts:
        found.insert(int(rng.integers(0, len(found) + 1)), coast)
    return found


def _braked(kind: str, rng: np.random.Generator) -> tuple[Course, float]:
    """A log with a stop, and about how long it is."""
    stop_s, before_s = rng.uniform(3.2, 7.5), rng.uniform(1.5, 4.0)
    if kind == "bend":
        speed = rng.uniform(45.0, 65.0) / 3.6
        wanted = rng.uniform(2.2, 3.4)
        before_s += 1.5
        curvature = rng.choice([-1.0, 1.0]) * rng.uniform(1.5, 3.0) / speed**2
        return _course(
            speed, [(before_s, 0.0), (LONGEST_STOP_S, wanted)], curvature, rng
        ), before_s + speed / wanted + 1.2
    least = {"stop": 45.0, "parts": 75.0, "hard": 85.0}[kind]
    speed = rng.uniform(least, 120.0) / 3.6
    parts = [(before_s, 0.0)]
    left = speed - 0.12 * before_s
    if kind == "parts":
        snub_s, snub, pause_s = rng.uniform(1.2, 2.2), rng.uniform(1.5, 3.5), rng.uniform(2.0, 3.5)
        parts += [(snub_s, snub), (pause_s, 0.0)]
        left -= snub_s * snub
    wanted = rng.uniform(6.2, 7.4) if kind == "hard" else float(np.clip(left / stop_s, 1.6, 5.6))
    length = sum(part[0] for part in parts) + left / wanted + REST_S
    return _course(speed, [*parts, (LONGEST_STOP_S, wanted)], 0.0, rng), length


def foot_force_n(deceleration_mps2: float) -> float:
    """Force of the foot for a deceleration of the laden car, about: what the driver aims at."""
    front = 2.0 * MU * PISTON_M2[0] * BRAKE_RADIUS_M[0] * EFFICIENCY
    rear = drum_factor(MU) * PISTON_M2[2] * BRAKE_RADIUS_M[2] * EFFICIENCY
    pressure = max(deceleration_mps2 - 0.12, 0.0) * MASS_KG * RADIUS_M / (2.0 * front + 1.4 * rear)
    return BOOSTER_FORCE_N + pressure / BOOSTER_GAIN_PA_N if pressure > 0.0 else 0.0


def _course(speed_mps: float, parts: list[tuple[float, float]], curvature: float, rng: np.random.Generator) -> Course:
    """Inputs from parts (duration s, wanted deceleration m/s2)."""
    count = round((LEAD_S + sum(part[0] for part in parts)) / STEP_S)
    t: Vector = np.arange(count, dtype=np.float64) * STEP_S
    times, forces = [0.0], [0.0]
    at = LEAD_S
    for duration, wanted in parts:
        force = foot_force_n(wanted)
        ramp = rng.uniform(0.25, 0.6) if force > forces[-1] else rng.uniform(0.12, 0.3)
        times += [at, at + ramp]
        forces += [forces[-1], force]
        at += duration
    foot = np.interp(t, times, forces) * (1.0 + slow_noise(rng, count, STEP_S, 0.04, 0.8))
    in_s, late_s = rng.uniform(0.8, 1.4), rng.uniform(0.2, 0.6)
    bend = np.interp(t, [LEAD_S + late_s, LEAD_S + late_s + in_s], [0.0, curvature])
    hill = np.array([
        rng.normal(0.0, HILL, len(HILL_M)), 2.0 * np.pi / (np.array(HILL_M) * rng.uniform(0.8, 1.25, len(HILL_M))),
        rng.uniform(0.0, 2.0 * np.pi, len(HILL_M)),
    ])  # fmt: skip
    return Course(
        speed_mps, foot, bend, slow_noise(rng, count, STEP_S, 0.012, 0.6),
        slow_noise(rng, count, STEP_S, GUST_MPS, GUST_S), hill, 350.0 + rng.normal(0.0, 8.0, 4),
    )  # fmt: skip


def slope_mps2(hills: list[Vector], speed_mps: float) -> tuple[float, float]:
    """Standard deviation (m/s2) and time constant (s) of the weight along the road over some logs."""
    power = float(np.mean([np.sum(hill[0] ** 2) / 2.0 for hill in hills]))
    rate = float(np.mean([np.sum(hill[0] ** 2 * hill[1]) / np.sum(hill[0] ** 2) for hill in hills]))
    return G * power**0.5, 1.0 / (rate * speed_mps)

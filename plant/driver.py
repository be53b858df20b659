"""The driver: brake pedal and steering by trace, speed by feel."""

import math

from plant.manoeuvre import Manoeuvre, value_at
from plant.vehicle import GRAVITY_MPS2

PEDAL_FREE = 0.01  # travel below which the foot is off the brake
SPEED_GAIN_1_S = 2.0
ACCELERATION_LIMIT_MPS2 = 3.0


def pedal_travel(manoeuvre: Manoeuvre, time_s: float) -> float:
    """Brake pedal travel, 0 to 1."""
    return min(max(value_at(manoeuvre.pedal, time_s), 0.0), 1.0)


def target_speed(manoeuvre: Manoeuvre, time_s: float) -> float | None:
    """Speed the driver holds at a time, m/s, or None when the car is left to roll."""
    for phase in manoeuvre.speed_phases:
        if phase.start_s <= time_s < phase.end_s:
            return phase.speed_mps
    return None


def drive_force(target_mps: float, speed_mps: float, mass_kg: float, resistance_n: float, grade: float) -> float:
    """Force with which the driver holds a speed, N: the resistance felt, and a share of the speed error."""
    push = SPEED_GAIN_1_S * (target_mps - speed_mps)
    push = min(max(push, -ACCELERATION_LIMIT_MPS2), ACCELERATION_LIMIT_MPS2)
    return mass_kg * (push + GRAVITY_MPS2 * math.sin(math.atan(grade))) + resistance_n

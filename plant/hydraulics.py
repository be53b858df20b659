"""Electro-hydraulic brake: closed pressure loop, clamping force, and the pedal map it falls back to."""

from math import pi

from plant.compiled import equation


@equation
def pressure_jerk(
    demand_pa: float,
    pressure_pa: float,
    rate_pa_s: float,
    frequency_hz: float,
    damping: float,
    build_pa_s: float,
    release_pa_s: float,
) -> float:
    """Second derivative of the pressure, Pa/s2: p'' = w^2 (p* - p) - 2 zeta w p', its rate held inside the limits.

    Second-order transfer with rate limits as in the paper (its reference 16). At a limit the rate does not grow on.
    """
    omega = 2.0 * pi * frequency_hz
    jerk = omega * omega * (demand_pa - pressure_pa) - 2.0 * damping * omega * rate_pa_s
    held_up = (rate_pa_s >= build_pa_s) & (jerk > 0.0)
    held_down = (rate_pa_s <= -release_pa_s) & (jerk < 0.0)
    return 0.0 if held_up | held_down else jerk


@equation
def pad_force(pressure_pa: float, area_m2: float, threshold_pa: float, efficiency: float) -> float:
    """Force on one pad, N: N = eta A (p - p0), none below the threshold pressure p0 (Breuer/Bill, Bremsenhandbuch)."""
    return efficiency * area_m2 * max(pressure_pa - threshold_pa, 0.0)


@equation
def sliding_torque(mu: float, pad_force_n: float, radius_m: float) -> float:
    """Torque of the sliding brake, N m, a magnitude: 2 mu N r (two faces)."""
    return 2.0 * mu * pad_force_n * radius_m


@equation
def brake_gain(mu: float, area_m2: float, radius_m: float, efficiency: float) -> float:
    """Torque of the sliding brake per pressure above the threshold, N m/Pa: 2 mu eta A r.

    The slope of `sliding_torque` over the pressure in `pad_force`; for what needs the ratio alone.
    """
    return 2.0 * mu * efficiency * area_m2 * radius_m


@equation
def windup_held(windup_rad: float, speed_rad_s: float, time_s: float, limit_rad: float) -> float:
    """Wind-up that acts now, rad: z + tau omega, at most the sliding limit either way.

    The torque is -K times it and z follows with time constant tau: Coulomb friction while the wheel turns, a damped
    spring at rest. So the brake holds on a grade without creeping, and the equations stay smooth
    (docs/decisions/vehicle-model-and-effects.md).
    """
    return min(max(windup_rad + time_s * speed_rad_s, -limit_rad), limit_rad)


def pedal_map_pa(travel: float, free_travel: float, linear_pa: float, square_pa: float, cubic_pa: float) -> float:
    """Pressure the brake gives by its own pedal sensor, Pa: a cubic in the travel beyond the free travel."""
    s = min(max((travel - free_travel) / (1.0 - free_travel), 0.0), 1.0)
    return linear_pa * s + square_pa * s**2 + cubic_pa * s**3

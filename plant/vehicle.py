"""Forces on the body that do not come through the tyres."""

from plant.compiled import equation

GRAVITY_MPS2 = 9.81
"""Gravity of the plant's road, usual in engineering. The controller computes with standard gravity, 9.80665
(`ecu.law.gravity.GRAVITY_MPS2`): 0.03 % less."""


@equation
def dynamic_pressure_area(speed_mps: float, density: float, area_m2: float) -> float:
    """Half rho A v |v|, N per unit coefficient, signed like the speed."""
    return 0.5 * density * area_m2 * speed_mps * abs(speed_mps)


@equation
def rolling_resistance(speed_mps: float, constant: float, square_s2_m2: float) -> float:
    """Coefficient f = f0 + f2 v^2, fading in over the first 0.1 m/s so that a standing car is not pushed."""
    fade = min(max(speed_mps / 0.1, -1.0), 1.0)
    return (constant + square_s2_m2 * speed_mps * speed_mps) * fade

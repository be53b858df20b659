"""Vehicle body, suspension and wheel. Pairs are (front, rear)."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class VehicleParameters:
    """Body, aerodynamics, rolling resistance and steering."""

    mass_kg: Annotated[float, "kg", 300.0, 5000.0]
    unsprung_mass_kg: Annotated[tuple[float, float], "kg", 10.0, 500.0]  # both wheels of an axle
    cog_to_axle_m: Annotated[tuple[float, float], "m", 0.3, 5.0]
    cog_height_m: Annotated[float, "m", 0.1, 2.0]
    track_m: Annotated[tuple[float, float], "m", 0.5, 3.0]
    roll_inertia_kg_m2: Annotated[float, "kg m2", 50.0, 20000.0]
    pitch_inertia_kg_m2: Annotated[float, "kg m2", 100.0, 50000.0]
    yaw_inertia_kg_m2: Annotated[float, "kg m2", 100.0, 50000.0]
    frontal_area_m2: Annotated[float, "m2", 0.5, 12.0]
    drag_coefficient: Annotated[float, "", 0.0, 2.0]
    lift_coefficient: Annotated[tuple[float, float], "", -3.0, 3.0]
    air_density_kg_m3: Annotated[float, "kg/m3", 0.5, 2.0]
    rolling_resistance: Annotated[float, "", 0.0, 0.1]
    rolling_resistance_speed_s2_m2: Annotated[float, "s2/m2", 0.0, 1e-4]
    steering_ratio: Annotated[float, "", 1.0, 50.0]
    slip_angle_share: Annotated[tuple[float, float], "", 0.2, 2.0]  # of an axle's slip angle, at its tyres


@dataclass(frozen=True, slots=True)
class SuspensionParameters:
    """Springs and dampers at the wheel, per side, and the support angles of the links under brakes and motors."""

    ride_rate_n_m: Annotated[tuple[float, float], "N/m", 5e3, 5e5]
    progression_n_m3: Annotated[tuple[float, float], "N/m3", 0.0, 1e8]
    damping_ns_m: Annotated[tuple[float, float], "N s/m", 0.0, 5e4]
    anti_roll_nm_rad: Annotated[tuple[float, float], "N m/rad", 0.0, 2e5]
    brake_support_tangent: Annotated[tuple[float, float], "", 0.0, 1.5]
    drive_support_tangent: Annotated[tuple[float, float], "", -0.5, 1.5]
    roll_centre_height_m: Annotated[tuple[float, float], "m", -0.2, 0.6]


@dataclass(frozen=True, slots=True)
class WheelParameters:
    """Wheel with tyre, motor rotor and disc."""

    rolling_radius_m: Annotated[float, "m", 0.1, 1.0]
    inertia_kg_m2: Annotated[tuple[float, float], "kg m2", 0.05, 50.0]
    brake_windup_nm_rad: Annotated[float, "N m/rad", 1e3, 1e6]
    brake_windup_time_s: Annotated[float, "s", 1e-3, 0.1]

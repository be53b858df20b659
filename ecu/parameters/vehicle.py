"""What the controller believes about the car. Nominal values of its own, never the plant's."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class VehicleParameters:
    """The car as the controller models it; per-axle values front, rear."""

    mass_kg: Annotated[float, "kg", 500.0, 5000.0]
    wheelbase_m: Annotated[float, "m", 1.5, 5.0]
    cog_to_front_axle_m: Annotated[float, "m", 0.5, 3.0]
    cog_height_m: Annotated[float, "m", 0.2, 1.5]
    track_m: Annotated[tuple[float, float], "m", 1.0, 2.5]
    rolling_radius_m: Annotated[float, "m", 0.2, 0.6]
    force_arm_m: Annotated[float, "m", 0.2, 0.6]
    wheel_inertia_kg_m2: Annotated[float, "kg m2", 0.1, 10.0]
    drag_area_m2: Annotated[float, "m2", 0.1, 3.0]
    air_density_kg_m3: Annotated[float, "kg/m3", 0.8, 1.5]
    rolling_resistance: Annotated[float, "1", 0.0, 0.05]
    steering_ratio: Annotated[float, "1", 5.0, 30.0]
    dive_gradient_rad_s2_m: Annotated[float, "rad s2/m", 0.0, 0.02]


@dataclass(frozen=True, slots=True)
class FrictionBrakeParameters:
    """The friction brake as the controller models it (paper eq. 16); per-axle values front, rear."""

    pad_friction: Annotated[float, "1", 0.05, 1.0]
    effective_radius_m: Annotated[tuple[float, float], "m", 0.05, 0.25]
    cylinder_area_m2: Annotated[tuple[float, float], "m2", 1e-4, 1e-2]
    efficiency: Annotated[float, "1", 0.5, 1.0]
    threshold_pressure_pa: Annotated[float, "Pa", 0.0, 5e5]
    pressure_max_pa: Annotated[float, "Pa", 1e6, 2.5e7]
    front_share: Annotated[float, "1", 0.0, 1.0]


@dataclass(frozen=True, slots=True)
class MotorParameters:
    """The in-wheel motors and their battery as the controller models them."""

    torque_per_current_nm_a: Annotated[float, "Nm/A", 0.1, 20.0]
    torque_max_nm: Annotated[float, "Nm", 0.0, 1500.0]
    charge_efficiency: Annotated[float, "1", 0.3, 1.0]

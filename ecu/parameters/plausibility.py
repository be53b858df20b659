"""What one sensor or motor may do before it is not believed."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class PlausibilityParameters:
    """Limits of the plausibility checks, and how long what exceeds them is watched (`ecu.law.debounce.up_down`)."""

    forget: Annotated[float, "1", 0.0, 1.0]
    heal_s: Annotated[float, "s", 0.0, 60.0]
    wheel_s: Annotated[float, "s", 0.001, 1.0]
    wheel_fall_rad_s2: Annotated[float, "rad/s2", 100.0, 1e5]
    wheel_rise_rad_s2: Annotated[float, "rad/s2", 100.0, 1e5]
    wheel_above: Annotated[float, "1", 0.0, 1.0]
    wheel_above_mps: Annotated[float, "m/s", 0.0, 20.0]
    speed_max_mps: Annotated[float, "m/s", 10.0, 150.0]
    pressure_s: Annotated[float, "s", 0.001, 1.0]
    pressure_pa: Annotated[float, "Pa", 1e4, 5e6]
    pressure_share: Annotated[float, "1", 0.0, 1.0]
    pressure_lag_s: Annotated[float, "s", 0.0, 1.0]
    motor_s: Annotated[float, "s", 0.001, 1.0]
    motor_nm: Annotated[float, "Nm", 1.0, 500.0]
    motor_share: Annotated[float, "1", 0.0, 1.0]
    motor_lag_s: Annotated[float, "s", 0.0, 1.0]
    motor_rate_nm_s: Annotated[float, "Nm/s", 100.0, 1e5]
    motor_start_s: Annotated[float, "s", 0.0, 5.0]
    motor_retry_s: Annotated[float, "s", 0.0, 600.0]
    acceleration_s: Annotated[float, "s", 0.001, 2.0]
    acceleration_mps2: Annotated[float, "m/s2", 0.1, 10.0]
    acceleration_share: Annotated[float, "1", 0.0, 1.0]
    acceleration_lag_s: Annotated[float, "s", 0.01, 1.0]
    acceleration_jump_mps2: Annotated[float, "m/s2", 0.5, 50.0]
    acceleration_rough_mps2: Annotated[float, "m/s2", 0.1, 50.0]
    pedal_jump: Annotated[float, "1", 0.01, 1.0]
    pedal_rise_1_s: Annotated[float, "1/s", 0.1, 100.0]

"""Sensors. Quantisation is not here: it belongs to the DBC."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """Sensor errors: filters, offsets and the standard deviation of the noise of one sample."""

    teeth: Annotated[float, "", 4.0, 1000.0]
    tooth_timeout_s: Annotated[float, "s", 0.05, 5.0]
    wheel_speed_noise: Annotated[float, "", 0.0, 0.1]  # share of the speed
    imu_cutoff_hz: Annotated[float, "Hz", 1.0, 500.0]
    acceleration_offset_mps2: Annotated[tuple[float, float], "m/s2", -2.0, 2.0]  # longitudinal, lateral
    acceleration_noise_mps2: Annotated[float, "m/s2", 0.0, 2.0]
    yaw_rate_offset_rad_s: Annotated[float, "rad/s", -0.5, 0.5]
    yaw_rate_noise_rad_s: Annotated[float, "rad/s", 0.0, 0.5]
    pressure_offset_pa: Annotated[tuple[float, float, float, float], "Pa", -1e6, 1e6]
    pressure_noise_pa: Annotated[float, "Pa", 0.0, 1e6]
    pedal_offset: Annotated[tuple[float, float], "", -0.2, 0.2]  # channel 1, channel 2
    pedal_noise: Annotated[float, "", 0.0, 0.1]
    current_noise_a: Annotated[float, "A", 0.0, 50.0]
    steering_noise_rad: Annotated[float, "rad", 0.0, 0.5]

"""In-wheel motors and traction battery."""

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, slots=True)
class MotorParameters:
    """One in-wheel motor without gear; all four are equal."""

    peak_torque_nm: Annotated[float, "N m", 0.0, 5000.0]
    peak_power_w: Annotated[float, "W", 0.0, 500e3]
    max_speed_rad_s: Annotated[float, "rad/s", 10.0, 1000.0]
    time_constant_s: Annotated[float, "s", 1e-3, 0.5]
    rate_limit_nm_s: Annotated[float, "N m/s", 10.0, 1e6]
    fade_end_mps: Annotated[float, "m/s", 0.0, 10.0]  # no braking torque at or below this speed
    fade_start_mps: Annotated[float, "m/s", 0.1, 20.0]  # full braking torque above this speed
    torque_constant_nm_a: Annotated[float, "N m/A", 0.01, 20.0]
    copper_loss_w_nm2: Annotated[float, "W/(N m)2", 0.0, 1.0]
    winding_resistance_k_w: Annotated[float, "K/W", 0.0, 10.0]
    winding_time_s: Annotated[float, "s", 1.0, 3600.0]
    derating_start_k: Annotated[float, "K", 300.0, 1e4]
    derating_end_k: Annotated[float, "K", 300.0, 1e4]  # so hot: no derating


@dataclass(frozen=True, slots=True)
class BatteryParameters:
    """Energy content and the power it accepts."""

    capacity_j: Annotated[float, "J", 1e5, 2e9]
    charge_power_w: Annotated[float, "W", 0.0, 1e6]
    discharge_power_w: Annotated[float, "W", 0.0, 1e6]
    taper_start_soc: Annotated[float, "", 0.0, 1.0]  # full charge power up to here
    taper_end_soc: Annotated[float, "", 0.0, 1.0]  # none from here on
    notice_s: Annotated[float, "s", 0.0, 60.0]  # a limit is announced this long before it is enforced

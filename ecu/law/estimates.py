"""Plain estimates straight from bus signals."""

import math

from ecu.law.friction import friction_torque
from ecu.law.types import Four, Inputs, Source
from ecu.parameters.vehicle import FrictionBrakeParameters, MotorParameters


def usable_wheel_speeds(inputs: Inputs, lost: tuple[bool, ...]) -> list[float]:
    """Wheel speeds that are present and not timed out, rad/s."""
    front = () if lost[Source.WHEEL_SPEED_FRONT] else inputs.wheel_speed_rad_s[:2]
    rear = () if lost[Source.WHEEL_SPEED_REAR] else inputs.wheel_speed_rad_s[2:]
    return [w for w in (*front, *rear) if math.isfinite(w)]


def motor_torques(current_a: Four, p: MotorParameters) -> Four:
    """Motor torque at each wheel from its current, Nm, negative braking; 0 where the current is not known."""
    k = p.torque_per_current_nm_a
    a, b, c, d = (k * i if math.isfinite(i) else 0.0 for i in current_a)
    return (a, b, c, d)


def nominal_wheel_torque(
    pressure_pa: Four, motor_nm: Four, pad_friction: float, gain_m3: Four, p: FrictionBrakeParameters
) -> Four:
    """Wheel torque the nominal brake model gives, Nm, negative braking; NaN where the pressure is not known."""
    a, b, c, d = (
        m - friction_torque(q, pad_friction, g, p) if math.isfinite(q) else math.nan
        for m, q, g in zip(motor_nm, pressure_pa, gain_m3, strict=True)
    )
    return (a, b, c, d)

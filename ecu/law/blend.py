"""Blending: which part of each wheel's brake torque the motor gives (paper eq. 2); friction takes the rest."""

from typing import NamedTuple

from ecu.law.types import ZERO, Four
from ecu.parameters.control import BlendParameters
from ecu.parameters.vehicle import MotorParameters


class Blend(NamedTuple):
    """Torques of each wheel, Nm, positive braking."""

    motor_nm: Four
    friction_nm: Four


def fade(speed_mps: float, p: BlendParameters) -> float:
    """Share of the motors' work that is left at low speed: 1 above ``fade_start``, 0 below ``fade_end``."""
    return min(max((speed_mps - p.fade_end_mps) / (p.fade_start_mps - p.fade_end_mps), 0.0), 1.0)


def blend(
    demand_nm: Four,
    factor: float,
    available_nm: Four,
    charge_power_w: float,
    speed_mps: float,
    wheel_speed_rad_s: float,
    deceleration_mps2: float,
    p: BlendParameters,
    motor: MotorParameters,
) -> Blend:
    """Share the demanded brake torque of each wheel between motor and friction.

    alpha T_dem of every wheel is asked of its motor (paper eq. 2), as far as the torque available, the power the
    battery takes and the low-speed fade-out allow; friction takes exactly what is left. As the friction brake is
    slower, its part of the fade-out is computed for the speed the car will have ``friction_lead`` later.

    Parameters
    ----------
    demand_nm : brake torque of each wheel, positive.
    factor : blending factor alpha, 0..1.
    available_nm : what each motor can give, 0 where it must not be used.
    charge_power_w : electrical power the battery takes.
    wheel_speed_rad_s : mean wheel speed, for the power.
    """
    if factor <= 0.0:
        return Blend(ZERO, demand_nm)
    wanted = [min(factor * t, a, motor.torque_max_nm) for t, a in zip(demand_nm, available_nm, strict=True)]
    power = sum(wanted) * max(wheel_speed_rad_s, 0.0) * motor.charge_efficiency
    limit = min(charge_power_w / power, 1.0) if power > 0.0 else 1.0
    now = limit * fade(speed_mps, p)
    soon = limit * fade(speed_mps - p.friction_lead_s * deceleration_mps2, p)
    m0, m1, m2, m3 = wanted
    d0, d1, d2, d3 = demand_nm
    return Blend(
        (now * m0, now * m1, now * m2, now * m3),
        (d0 - soon * m0, d1 - soon * m1, d2 - soon * m2, d3 - soon * m3),
    )

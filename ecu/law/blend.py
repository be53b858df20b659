"""Blending: which part of each wheel's brake torque the motor gives (paper eq. 2); friction takes the rest."""

import math
from typing import NamedTuple

from ecu.law.compiled import shared
from ecu.law.types import ZERO, Four
from ecu.parameters.control import BlendParameters
from ecu.parameters.vehicle import MotorParameters


class ChargePower(NamedTuple):
    """Charge power that the shares count on, W: friction with that of soon, the motors with that of now.

    ``built_w`` lies between the two: what the brake's pressure has begun to follow.
    """

    soon_w: float
    built_w: float
    now_w: float


class Blend(NamedTuple):
    """Torques of each wheel, Nm, positive braking."""

    motor_nm: Four
    friction_nm: Four


@shared
def fade(speed_mps: float, p: BlendParameters) -> float:
    """Share of the motors' work that is left at low speed: 1 above ``fade_start``, 0 below ``fade_end``."""
    return min(max((speed_mps - p.fade_end_mps) / (p.fade_start_mps - p.fade_end_mps), 0.0), 1.0)


@shared
def wanted_torque(demand_nm: Four, factor: float, available_nm: Four, motor: MotorParameters) -> Four:
    """Torque asked of each motor, Nm: alpha T_dem (paper eq. 2) as far as it is available."""
    if factor <= 0.0:
        return ZERO
    (d0, d1, d2, d3), (a0, a1, a2, a3), most = demand_nm, available_nm, motor.torque_max_nm
    return (
        min(factor * d0, a0, most),
        min(factor * d1, a1, most),
        min(factor * d2, a2, most),
        min(factor * d3, a3, most),
    )


@shared
def ramp_charge_limit(
    held: ChargePower, announced_w: float, power_w: float, p: BlendParameters, dt_s: float
) -> ChargePower:
    """Follow the battery's announced limit so that the work changes hands evenly, the slower actuator first.

    A battery announces a limit before it enforces it. Where the new limit binds, ``soon_w`` goes there from the power
    in use within ``charge_handover``, and ``now_w`` follows as the pressure does: two equal lags, a brake of second
    order, critically damped, that is as late as the fade-out's ``friction_lead``.

    Parameters
    ----------
    held : of the last step.  announced_w : limit that the battery announces (NaN counts as none accepted).
    power_w : electrical power of the torque wanted of the motors.
    """
    target = announced_w if math.isfinite(announced_w) else 0.0
    if power_w <= min(held) and power_w <= target:
        return ChargePower(target, target, target)
    soon, built, now = min(held.soon_w, power_w), min(held.built_w, power_w), min(held.now_w, power_w)
    most = power_w * dt_s / p.charge_handover_s
    soon += min(max(min(target, power_w) - soon, -most), most)
    share = dt_s / (0.5 * p.friction_lead_s + dt_s)
    built += share * (soon - built)
    return ChargePower(soon, built, now + share * (built - now))


@shared
def blend(
    demand_nm: Four,
    wanted_nm: Four,
    power_w: float,
    charge: ChargePower,
    speed_mps: float,
    deceleration_mps2: float,
    p: BlendParameters,
) -> Blend:
    """Share the demanded brake torque of each wheel between motor and friction.

    The motors give what is wanted of them as far as the battery's charge power and the low-speed fade-out allow;
    friction takes exactly what is left. As the friction brake is slower, its part of the fade-out is computed for the
    speed the car will have ``friction_lead`` later.

    Parameters
    ----------
    demand_nm : brake torque of each wheel, positive.  wanted_nm : part of it asked of each motor.
    power_w : electrical power of ``wanted_nm``.  charge : from `ramp_charge_limit`.
    """
    if power_w <= 0.0:
        now, soon = fade(speed_mps, p), fade(speed_mps - p.friction_lead_s * deceleration_mps2, p)
    else:
        now = min(charge.now_w / power_w, 1.0) * fade(speed_mps, p)
        soon = min(charge.soon_w / power_w, 1.0) * fade(speed_mps - p.friction_lead_s * deceleration_mps2, p)
    m0, m1, m2, m3 = wanted_nm
    d0, d1, d2, d3 = demand_nm
    return Blend(
        (now * m0, now * m1, now * m2, now * m3),
        (d0 - soon * m0, d1 - soon * m1, d2 - soon * m2, d3 - soon * m3),
    )

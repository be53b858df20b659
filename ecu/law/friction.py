"""Friction brake: torque and pressure through the pad friction (paper eq. 16)."""

from ecu.law.compiled import shared
from ecu.law.types import Four
from ecu.parameters.vehicle import FrictionBrakeParameters


def gains(p: FrictionBrakeParameters) -> Four:
    """Torque per pressure and unit of pad friction of each wheel, Nm/Pa = m3: 2 r_b A_cyl of paper eq. (16).

    The caliper's efficiency, which the paper leaves out, is part of it.
    """
    front, rear = (2.0 * r * a * p.efficiency for r, a in zip(p.effective_radius_m, p.cylinder_area_m2, strict=True))
    return (front, front, rear, rear)


@shared
def pressure_demands(torque_nm: Four, pad_friction: Four, gain_m3: Four, p: FrictionBrakeParameters) -> Four:
    """`pressure_demand` of each wheel."""
    (t0, t1, t2, t3), (m0, m1, m2, m3), (g0, g1, g2, g3) = torque_nm, pad_friction, gain_m3
    return (
        pressure_demand(t0, m0, g0, p),
        pressure_demand(t1, m1, g1, p),
        pressure_demand(t2, m2, g2, p),
        pressure_demand(t3, m3, g3, p),
    )


@shared
def pressure_demand(torque_nm: float, pad_friction: float, gain_m3: float, p: FrictionBrakeParameters) -> float:
    """Pressure for a friction torque, Pa (paper eq. 16 solved for p): p = T / (2 mu r_b A_cyl) + p_0.

    ``torque_nm`` positive; the threshold pressure p_0, below which pads only touch, is asked for with any torque.
    """
    if torque_nm <= 0.0:
        return 0.0
    return min(torque_nm / (pad_friction * gain_m3) + p.threshold_pressure_pa, p.pressure_max_pa)


def friction_torque(pressure_pa: float, pad_friction: float, gain_m3: float, p: FrictionBrakeParameters) -> float:
    """Friction torque from a pressure, Nm, positive (paper eq. 16): T = 2 mu r_b A_cyl (p - p_0)."""
    return pad_friction * gain_m3 * max(pressure_pa - p.threshold_pressure_pa, 0.0)

"""Base brake: pedal travel to demanded deceleration and wheel torques (paper Fig. 2, eq. 1)."""

from typing import NamedTuple

from ecu.law.compiled import shared
from ecu.law.gravity import GRAVITY_MPS2
from ecu.law.types import Four
from ecu.parameters.control import PedalParameters
from ecu.parameters.vehicle import VehicleParameters


class PedalReading(NamedTuple):
    """Travel 0..1 to act on (NaN: none), and what is wrong with the channels, debounced where they only disagree."""

    travel: float
    channel_1_lost: bool
    channel_2_lost: bool
    channels_disagree: bool
    implausible: tuple[bool, bool] = (False, False)


def reference_deceleration(travel: float, p: PedalParameters) -> float:
    """Demanded deceleration over pedal travel, m/s2 (paper Fig. 2, whose curve is not printed as numbers).

    a = g (c1 x + c2 x^2 + c3 x^3), x = (s - s0) / (1 - s0): progressive, zero within the free travel s0.
    """
    x = min(max((travel - p.free_travel) / (1.0 - p.free_travel), 0.0), 1.0)
    return GRAVITY_MPS2 * x * (p.map_linear + x * (p.map_quadratic + x * p.map_cubic))


@shared
def driving_resistance(speed_mps: float, mass_kg: float, p: VehicleParameters) -> float:
    """Air drag and rolling resistance, N (the force F_R of paper eq. 9); zero at standstill."""
    rolling = mass_kg * GRAVITY_MPS2 * p.rolling_resistance * min(speed_mps, 1.0)
    return 0.5 * p.air_density_kg_m3 * p.drag_area_m2 * speed_mps**2 + rolling


@shared
def brake_torque(deceleration_mps2: float, resistance_n: float, mass_kg: float, p: VehicleParameters) -> float:
    """Brake torque of all wheels together for a deceleration, Nm, positive (paper eq. 1).

    T = ((m + 4 I/r^2) a - F_R) r: eq. (1) with the wheels' inertia, which it leaves out (4 % of the mass), and less
    the driving resistances, which brake for nothing.
    """
    r = p.rolling_radius_m
    force = (mass_kg + 4.0 * p.wheel_inertia_kg_m2 / r**2) * deceleration_mps2 - resistance_n
    return max(force, 0.0) * p.force_arm_m


@shared
def distribute(torque_nm: float, front_share: float) -> Four:
    """Torque of each wheel from the torque of all: a fixed front share, left and right alike."""
    front = 0.5 * front_share * torque_nm
    rear = 0.5 * (1.0 - front_share) * torque_nm
    return (front, front, rear, rear)

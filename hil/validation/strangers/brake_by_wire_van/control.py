"""The van's brake control: the motor first, the clamping force for the rest."""

from hil.validation.strangers.compiled import compiled

TICK_MS = 10
FRONT_SHARE = 0.64
MOST_NM, MOST_W = 1900.0, 70e3
"""Torque and power of the motor at the wheels, both wheels together."""
FADE_END_MPS, FADE_START_MPS = 1.2, 4.0
RATE_NM_S = 5000.0


@compiled
def motor_demand_nm(asked_nm: float, before_nm: float, speed_mps: float, radius_m: float) -> float:
    """Torque demanded of the motor at the wheels, both together.

    Parameters
    ----------
    asked_nm : by pedals; braking is negative.  before_nm : demanded at the tick before.  speed_mps : of the van.
    """
    most = min(MOST_NM, MOST_W * radius_m / max(speed_mps, 1.0))
    wanted = max(-most, min(most, asked_nm))
    if wanted < 0.0:
        wanted *= min(max((speed_mps - FADE_END_MPS) / (FADE_START_MPS - FADE_END_MPS), 0.0), 1.0)
    step = RATE_NM_S * TICK_MS * 1e-3
    return max(before_nm - step, min(before_nm + step, wanted))


@compiled
def pressure_demands_pa(torque_nm: float, front_gain_nm_pa: float, rear_gain_nm_pa: float) -> tuple[float, float]:
    """Clamping of one front and one rear wheel for a friction torque of all four, told as pressure."""
    if torque_nm <= 0.0:
        return 0.0, 0.0
    front = 0.5 * FRONT_SHARE * torque_nm / front_gain_nm_pa
    rear = 0.5 * (1.0 - FRONT_SHARE) * torque_nm / rear_gain_nm_pa
    return front + 5e4, rear + 5e4

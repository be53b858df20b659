"""Compensation: the estimated pad friction instead of the nominal one between torque and pressure.

The friction in use follows the estimate at a rate that is limited and scales with the estimate's confidence, within
an authority round the nominal value. At no confidence it holds: what was learned in the last stop is the best guess
for the next, and an estimate nobody trusts moves nothing.
"""

from ecu.law.compiled import shared
from ecu.law.types import Four
from ecu.parameters.observer import CompensationParameters


@shared
def friction_in_use(
    used: Four, estimate: Four, confidence: Four, nominal: float, p: CompensationParameters, dt_s: float
) -> Four:
    """Pad friction of each wheel to convert torque to pressure with.

    Parameters
    ----------
    used : what was in use in the last step.
    estimate, confidence : estimated pad friction and its confidence, 0..1.
    nominal : nominal pad friction, the centre of the authority.
    dt_s : time since the last step.
    """
    if not p.enabled:
        return (nominal, nominal, nominal, nominal)
    low = max(nominal * (1.0 - p.authority), p.friction_lowest)
    high = min(nominal * (1.0 + p.authority), p.friction_highest)
    rate = p.rate_1_s * nominal
    (u0, u1, u2, u3), (e0, e1, e2, e3), (k0, k1, k2, k3) = used, estimate, confidence
    return (
        _toward(u0, low if e0 < low else high if e0 > high else e0, rate * k0 * dt_s),
        _toward(u1, low if e1 < low else high if e1 > high else e1, rate * k1 * dt_s),
        _toward(u2, low if e2 < low else high if e2 > high else e2, rate * k2 * dt_s),
        _toward(u3, low if e3 < low else high if e3 > high else e3, rate * k3 * dt_s),
    )


@shared
def _toward(value: float, target: float, most: float) -> float:
    change = target - value
    return value + (most if change > most else -most if change < -most else change)


@shared
def motor_factor(factor: float, friction: Four, nominal: float, p: CompensationParameters) -> float:
    """Blending factor with work moved to the motors where the pads are weak, 0..1.

    alpha' = alpha (1 + k max(0, s - mean(mu) / mu_nominal)): "keeping the brakes in their optimal operating
    conditions" (paper, introduction). Blending that is switched off stays off.
    """
    f0, f1, f2, f3 = friction  # no sum(): uncompiled it compensates from Python 3.12 on
    lack = max(p.motor_preference_from - 0.25 * (f0 + f1 + f2 + f3) / nominal, 0.0)
    return min(factor * (1.0 + p.motor_preference * lack), 1.0)

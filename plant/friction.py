"""Pad friction: Ostermeyer's dynamic model, equations (3) and (4) of the paper.

What the print leaves open, and what we take (docs/decisions/pad-friction.md): T in kelvin; N the force on one pad and
v the sliding speed at the effective radius; T0 the ambient temperature; heating with N v as printed or with mu N v.
"""

from plant.compiled import equation


@equation
def mu_rate(mu: float, power_w: float, temperature_k: float, a: float, b: float, eps: float) -> float:
    """Rate of the pad friction coefficient, 1/s.

    Ricciardi et al., equation (3): mu' = -[b (N v + eps) mu - a T].

    Parameters
    ----------
    mu : friction coefficient.  power_w : N v, force on one pad times sliding speed, W.
    temperature_k : T.  a : 1/(K s).  b : 1/J.  eps : W.
    """
    return -(b * (power_w + eps) * mu - a * temperature_k)


@equation
def temperature_rate(temperature_k: float, power_w: float, reference_k: float, c: float, gamma: float) -> float:
    """Rate of the temperature in the friction model, K/s.

    Ricciardi et al., equation (4): T' = -c [(T - T0) - gamma N v].

    Parameters
    ----------
    temperature_k : T.  power_w : N v as printed, or mu N v.  reference_k : T0.  c : 1/s.  gamma : K/W.
    """
    return -c * ((temperature_k - reference_k) - gamma * power_w)


@equation
def mu_equilibrium(power_w: float, temperature_k: float, a: float, b: float, eps: float) -> float:
    """Friction coefficient at which equation (3) rests: (a / b) T / (N v + eps)."""
    return a / b * temperature_k / (power_w + eps)

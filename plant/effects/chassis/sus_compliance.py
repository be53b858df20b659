"""Fore-aft compliance of the hubs."""

from math import pi

from plant.compiled import equation
from plant.effects.effect import Effect, Parameter, Scope, shape, slots
from plant.excitation import Excitation
from plant.inject import J
from plant.layout import Vector
from plant.vectors import X, Y

DAMPING_RATIO = 0.05

PARAMETERS = (
    Parameter("compliance_m_n", "m/N", 0.0, 2e-06, 5e-07, difference_step=0.5),
    shape("frequency_hz", "Hz", 8.0, 25.0, 15.0),
)
L = slots(Scope.AXLE, PARAMETERS)


@equation
def dynamic(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """d'' = w^2 (c F - d) - 2 zeta w d', the contact moves with d'."""
    for i in range(4):
        on = 1.0 if q[k + L.compliance_m_n + i // 2] != 0.0 else 0.0
        y[J.contact_speed + 4 + i] += on * x[X.hub_rate_mps + i]


@equation
def rates(x: Vector, u: Vector, q: Vector, k: int, y: Vector) -> None:
    """Rates of the extra states."""
    omega = 2.0 * pi * q[k + L.frequency_hz]
    for i in range(4):
        bent = q[k + L.compliance_m_n + i // 2] * y[Y.longitudinal_force_n + i]
        travel, rate = x[X.hub_m + i], x[X.hub_rate_mps + i]
        y[Y.hub_swing_1_s + i] = omega
        y[Y.hub_push_1_kg + i] = omega * omega * q[k + L.compliance_m_n + i // 2]
        y[Y.rate + X.hub_m + i] = rate
        y[Y.rate + X.hub_rate_mps + i] = omega * omega * (bent - travel) - 2.0 * DAMPING_RATIO * omega * rate
        y[Y.decay_1_s + X.hub_rate_mps + i] = 2.0 * DAMPING_RATIO * omega + 1e-3 * omega * omega


EFFECT = Effect(
    name="sus_compliance",
    row=9,
    title="Fore-aft compliance of the hubs",
    equation="d'' = w^2 (c F - d) - 2 zeta w d', the contact moves with d'",
    injection_points=("contact.speed",),
    acts_when=Excitation.MOVING,
    scope=Scope.AXLE,
    parameters=PARAMETERS,
    source="M: 12 to 20 Hz, 1 to 2 mm under braking",
    signature="ripple of the wheel speeds after a torque step, not in the acceleration",
    manoeuvre="regenerative_pulses",
    confounded_with=("tyre_relaxation", "wheel_tooth_error"),
    states=("hub_m", "hub_rate_mps"),
    dynamic=dynamic,
    rates=rates,
)

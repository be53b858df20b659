"""What no set states of a car: how far single brakes, motors, tyres and clocks are off, and its steering wheel."""

from collections.abc import Sequence

from hil.diagnosis.data.log import Floats
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, Nuisance
from plant.effects.effect import NODES
from plant.injection.theta import THETA
from plant.vectors import P

_PARTS = (
    ("pressure_offset", "offset_pa", 7e3), ("pressure_gain", "gain", 0.005), ("iwm_gain", "gain", 0.005),
    ("iwm_gain", "unseen", 0.005), ("pad_mu_gain", "gain", 0.01), ("tyre_radius", "gain", 0.0012),
)  # fmt: skip
"""Standard deviations of a pressure sensor's zero and gain, of the torque a motor gives of what is asked and of what it
tells, of the pads' friction, and of a wheel's radius beside the others' (docs/decisions/0093 and 0094)."""
_CLOCK_SHARE = 5e-5
"""Standard deviation of the rate of one node's clock: quartz is good to 20 to 100 ppm (plant/effects/sensing)."""
_STRAIGHT_AHEAD_RAD = 0.01
"""Standard deviation of the steering wheel's angle at which a car goes straight. Workshop manuals let the sensor's zero
be set within 3 to 5 degrees of that (Hyundai Motor, Grandeur 2006: within 5, nonlinear by 2.5); here half a degree."""


def side_to_side_variation(p: Floats, motors: bool) -> tuple[Nuisance, ...]:
    """Nuisances of a car ``p`` whose maker states no more than usual; of its motors only if they are compared."""
    parts = [one for one in _PARTS if motors or one[:2] != ("iwm_gain", "gain")]
    return (*_by_wheel(parts), *_clocks(), _straight_ahead(p))


def line_lag(half_s: float) -> list[Nuisance]:
    """How much pads lag behind the sensors of their pressures, up to ``half_s`` usually; never ahead of them."""
    at = THETA.slice("pressure_location", "lag_s").start
    return [Nuisance("line_lag", (at,), (HALF_WIDTH_TO_SIGMA * half_s,), "line")] if half_s else []


def _by_wheel(parts: Sequence[tuple[str, str, float]]) -> list[Nuisance]:
    """What each brake, motor and tyre may be off by itself: effect, number and standard deviation."""
    return [
        Nuisance(f"{effect}.{number}_{wheel}", (THETA.slice(effect, number).start + k,), (step,), "scatter")
        for effect, number, step in parts
        for k, wheel in enumerate(("fl", "fr", "rl", "rr"))
    ]


def _clocks() -> list[Nuisance]:
    """By how much the clock of each node that measures may run fast."""
    first = THETA.slice("clock_drift", "share").start
    measure = [node for node in NODES if node != "driver"]
    return [
        Nuisance(f"clock_drift.share_{node}", (first + NODES.index(node),), (_CLOCK_SHARE,), "scatter")
        for node in measure
    ]


def _straight_ahead(p: Floats) -> Nuisance:
    """At which angle of the steering wheel it goes straight, as one of its front wheels."""
    at = THETA.slice("steer_lateral", "offset_rad").start
    return Nuisance("zero_steering", (at,), (_STRAIGHT_AHEAD_RAD / float(p[P.vehicle_steering_ratio]),), "sensor")

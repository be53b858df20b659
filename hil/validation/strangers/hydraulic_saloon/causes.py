"""What can be wrong with the saloon, and which answers are right.

Only measured pressures are logged. So a pad that bites less is, wheel by wheel, the same as a pressure that is told too
high, and as a calliper that is worse forward; one wheel's is a corner that gives too little.
"""

from collections.abc import Callable, Mapping
from typing import Any

from hil.validation.strangers.car import Cause, Hidden
from hil.validation.strangers.hydraulic_saloon.logger import Logger
from hil.validation.strangers.hydraulic_saloon.numbers import Numbers
from hil.validation.strangers.signals import Vector

Both = tuple[Numbers, Logger]
FRONT, REAR, FL, FR, RL, RR, ALL = (0, 1), (2, 3), (0,), (1,), (2,), (3,), (0, 1, 2, 3)


def _plus(values: Vector, at: tuple[int, ...], by: float) -> Vector:
    new = values.copy()
    new[list(at)] += by
    return new


def _times(values: Vector, at: tuple[int, ...], share: float) -> Vector:
    new = values.copy()
    new[list(at)] *= 1.0 + share
    return new


def _car(change: Callable[[Numbers, float], Mapping[str, Any]]) -> Callable[[Both, float], Both]:
    return lambda both, size: (both[0]._replace(**change(both[0], size)), both[1])


def _log(change: Callable[[Logger, float], Mapping[str, Any]]) -> Callable[[Both, float], Both]:
    return lambda both, size: (both[0], both[1]._replace(**change(both[1], size)))


def _pads(*places: str) -> tuple[str, ...]:
    return tuple(f"{effect}@{at}" for at in places for effect in ("pad_mu_gain", "pressure_gain", "caliper_asymmetry"))


_ROWS: tuple[tuple[str, str, float, float, tuple[str, ...], Callable[[Both, float], Both]], ...] = (
    ("front_pads", "", -0.02, -0.4, _pads("front"), _car(lambda c, e: {"mu": _times(c.mu, FRONT, e)})),
    ("rear_linings", "", 0.02, 0.4, _pads("rear"), _car(lambda c, e: {"mu": _times(c.mu, REAR, e)})),
    ("weak_corner", "", -0.03, -0.7, (*_pads("rl"), "stuck_corner@rl"),
     _car(lambda c, e: {"mu": _times(c.mu, RL, e)})),
    ("dragging_calliper", "N m", 2.0, 90.0, ("residual_drag@fr", "rolling_resistance@fr"),
     _car(lambda c, e: {"drag_nm": _plus(c.drag_nm, FR, e)})),
    ("seized_piston", "Pa", 8e4, 1.2e6, ("stuck_corner@fl", "residual_drag@fl", "rolling_resistance@fl"),
     _car(lambda c, e: {"held_pa": _plus(c.held_pa, FL, e)})),
    ("cold_front_pads", "", 0.04, 0.5, ("mu_warmup@front",),
     _car(lambda c, e: {"cold_loss": _plus(c.cold_loss, FRONT, e)})),
    ("pads_over_pressure", "", 0.02, 0.3, ("mu_pressure@front",),
     _car(lambda c, e: {"mu_exponent": _plus(c.mu_exponent, FRONT, e)})),
    ("judder", "", 0.01, 0.3, ("dtv_judder@fr",), _car(lambda c, e: {"judder": _plus(c.judder, FR, e)})),
    ("passengers", "kg", 30.0, 600.0, ("mass_offset",), _car(lambda c, e: {"mass_kg": c.mass_kg + e})),
    ("rolling_resistance", "", 0.1, 1.5, ("rolling_resistance", "residual_drag"),
     _car(lambda c, e: {"rolling": _times(c.rolling, ALL, e)})),
    ("headwind", "m/s", 1.0, 15.0, ("headwind",), _car(lambda c, e: {"wind_mps": c.wind_mps + e})),
    ("slope", "", 0.003, 0.06, ("road_grade",), _car(lambda c, e: {"grade": c.grade + e})),
    ("worn_tyre", "", -0.002, -0.04, ("tyre_radius@rr",),
     _car(lambda c, e: {"radius_m": _times(c.radius_m, RR, e)})),
    ("crooked_steering", "rad", 0.001, 0.04, ("steer_lateral",),
     _car(lambda c, e: {"toe_rad": c.toe_rad + e})),
    ("imu_scale", "", 0.015, 0.2, ("imu_gain", "wrong_scale@imu"),
     _log(lambda g, e: {"ax_gain": g.ax_gain + e})),
    ("imu_zero", "m/s2", 0.06, 0.8, ("imu_bias", "imu_gain"),
     _log(lambda g, e: {"ax_zero_mps2": g.ax_zero_mps2 + e})),
    ("imu_late", "s", 0.03, 0.2, ("timestamp_offset@imu", "imu_filter"),
     _log(lambda g, e: {"imu_age_s": g.imu_age_s + e})),
    ("pressure_zero", "Pa", 4e4, 5e5, ("pressure_offset@fr", "threshold@fr"),
     _log(lambda g, e: {"pressure_zero_pa": _plus(g.pressure_zero_pa, FR, e)})),
    ("toothed_wheel", "", 0.001, 0.02, ("wheel_tooth_error@fl",),
     _log(lambda g, e: {"runout": _plus(g.runout, FL, e)})),
)  # fmt: skip
CAUSES = {row[0]: Cause(row[0], row[1], row[2], row[3], frozenset(row[4])) for row in _ROWS}
_APPLY = {row[0]: row[5] for row in _ROWS}


def with_hidden(both: Both, hidden: Hidden | None) -> Both:
    """The car and its logger with something wrong."""
    return both if hidden is None else _APPLY[hidden.cause](both, hidden.size)

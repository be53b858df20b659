"""What can be wrong with the van, and which answers are right.

The actuators hold their own force sensors at the demand: a sensor that tells too much and a pad that bites less are the
same to all signals. So are the scale of the motor's torque and of its messages.
"""

from collections.abc import Callable, Mapping
from typing import Any

from hil.validation.strangers.brake_by_wire_van.logger import Logger
from hil.validation.strangers.brake_by_wire_van.numbers import Numbers
from hil.validation.strangers.car import Cause, Hidden
from hil.validation.strangers.signals import Vector

Both = tuple[Numbers, Logger]
FRONT, FL, FR, RL, RR, ALL = (0, 1), (0,), (1,), (2,), (3,), (0, 1, 2, 3)


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
    ("front_pads", "", -0.02, -0.5, _pads("front"), _car(lambda c, e: {"gain_nm_pa": _times(c.gain_nm_pa, FRONT, e)})),
    ("weak_corner", "", -0.03, -0.8, (*_pads("fr"), "stuck_corner@fr"),
     _car(lambda c, e: {"gain_nm_pa": _times(c.gain_nm_pa, FR, e)})),
    ("pressure_scale", "", 0.015, 0.25, ("pressure_gain@rr",),
     _log(lambda g, e: {"pressure_gain": _plus(g.pressure_gain, RR, e)})),
    ("dragging_brake", "N m", 3.0, 150.0, ("residual_drag@rl", "rolling_resistance@rl"),
     _car(lambda c, e: {"drag_nm": _plus(c.drag_nm, RL, e)})),
    ("slow_actuators", "", -0.05, -0.75, ("ehb_bandwidth", "fluid_temp"),
     _car(lambda c, e: {"emb_hz": _times(c.emb_hz, ALL, e)})),
    ("late_actuators", "ms", 15.0, 150.0, ("ehb_dead_time",),
     _car(lambda c, e: {"emb_dead_ms": c.emb_dead_ms + e})),
    ("weak_motor", "", -0.02, -0.5, ("iwm_gain@rear", "wrong_scale@motor"),
     _car(lambda c, e: {"motor_gain": c.motor_gain * (1.0 + e)})),
    ("slow_motor", "s", 0.015, 0.25, ("motor_tau",), _car(lambda c, e: {"motor_s": c.motor_s + e})),
    ("overloaded", "kg", 80.0, 1500.0, ("mass_offset",), _car(lambda c, e: {"mass_kg": c.mass_kg + e})),
    ("rolling_resistance", "", 0.1, 1.5, ("rolling_resistance", "residual_drag"),
     _car(lambda c, e: {"rolling": _times(c.rolling, ALL, e)})),
    ("headwind", "m/s", 1.0, 15.0, ("headwind",), _car(lambda c, e: {"wind_mps": c.wind_mps + e})),
    ("slope", "", 0.003, 0.06, ("road_grade",), _car(lambda c, e: {"grade": c.grade + e})),
    ("worn_tyre", "", -0.002, -0.05, ("tyre_radius@fl",),
     _car(lambda c, e: {"radius_m": _times(c.radius_m, FL, e)})),
    ("crooked_steering", "rad", 0.001, 0.04, ("steer_lateral",),
     _car(lambda c, e: {"toe_rad": c.toe_rad + e})),
    ("imu_scale", "", 0.015, 0.3, ("imu_gain", "wrong_scale@imu"),
     _log(lambda g, e: {"ax_gain": g.ax_gain + e})),
    ("imu_zero", "m/s2", 0.06, 0.8, ("imu_bias", "imu_gain"),
     _log(lambda g, e: {"ax_zero_mps2": g.ax_zero_mps2 + e})),
    ("wheels_late", "s", 0.025, 0.25, ("timestamp_offset@wheel",),
     _log(lambda g, e: {"wheel_age_s": g.wheel_age_s + e})),
)  # fmt: skip
CAUSES = {row[0]: Cause(row[0], row[1], row[2], row[3], frozenset(row[4])) for row in _ROWS}
_APPLY = {row[0]: row[5] for row in _ROWS}


def with_hidden(both: Both, hidden: Hidden | None) -> Both:
    """The van and its logger with something wrong."""
    return both if hidden is None else _APPLY[hidden.cause](both, hidden.size)

"""What can be wrong with the saloon, and which answers are right.

Only measured pressures are logged. So a pad that bites less is, wheel by wheel, the same as a pressure that is told too
high, and as a calliper that is worse forward; one wheel's is a corner that gives too little.
"""

from hil.validation.strangers.car import Cause, Hidden
from hil.validation.strangers.changes import Change, plus, times
from hil.validation.strangers.hydraulic_saloon.logger import Logger
from hil.validation.strangers.hydraulic_saloon.numbers import Numbers

Both = tuple[Numbers, Logger]
FRONT, REAR, FL, FR, RL, RR = (0, 1), (2, 3), (0,), (1,), (2,), (3,)


def _pads(*places: str) -> tuple[str, ...]:
    return tuple(f"{effect}@{at}" for at in places for effect in ("pad_mu_gain", "pressure_gain", "caliper_asymmetry"))


_ROWS: tuple[tuple[str, str, float, float, tuple[str, ...], Change], ...] = (
    ("front_pads", "", -0.12, -0.5, _pads("front"), times("mu", FRONT)),
    ("rear_linings", "", 0.15, 0.4, _pads("rear"), times("mu", REAR)),
    ("weak_corner", "", -0.03, -0.7, (*_pads("rl"), "stuck_corner@rl"),
     times("mu", RL)),
    ("dragging_calliper", "N m", 2.0, 90.0, ("residual_drag@fr", "rolling_resistance@fr"),
     plus("drag_nm", FR)),
    ("seized_piston", "Pa", 8e4, 1.2e6, ("stuck_corner@fl", "residual_drag@fl", "rolling_resistance@fl"),
     plus("held_pa", FL)),
    ("cold_front_pads", "", 0.04, 0.5, ("mu_warmup@front",),
     plus("cold_loss", FRONT)),
    ("pads_over_pressure", "", 0.02, 0.3, ("mu_pressure@front",),
     plus("mu_exponent", FRONT)),
    ("judder", "", 0.002, 0.3, ("dtv_judder@fr",), plus("judder", FR)),
    ("passengers", "kg", 60.0, 600.0, ("mass_offset",), plus("mass_kg")),
    ("rolling_resistance", "", 0.7, 2.5, ("rolling_resistance", "residual_drag"),
     times("rolling")),
    ("headwind", "m/s", 6.0, 15.0, ("headwind",), plus("wind_mps")),
    ("slope", "", 0.015, 0.06, ("road_grade",), plus("grade")),
    ("worn_tyre", "", -0.01, -0.04, ("tyre_radius@rr",),
     times("radius_m", RR)),
    ("crooked_steering", "rad", 0.003, 0.04, ("steer_lateral",),
     plus("toe_rad")),
    ("imu_scale", "", 0.06, 0.2, ("imu_gain", "wrong_scale@imu"),
     plus("ax_gain")),
    ("imu_zero", "m/s2", 0.2, 0.8, ("imu_bias", "imu_gain"),
     plus("ax_zero_mps2")),
    ("pressure_zero", "Pa", 4e4, 5e5, ("pressure_offset@fr", "threshold@fr"),
     plus("pressure_zero_pa", FR)),
    ("toothed_wheel", "", 0.001, 0.02, ("wheel_tooth_error@fl",),
     plus("runout", FL)),
)  # fmt: skip
CAUSES = {row[0]: Cause(row[0], row[1], row[2], row[3], frozenset(row[4])) for row in _ROWS}
_APPLY = {row[0]: row[5] for row in _ROWS}


def with_hidden(both: Both, hidden: Hidden | None) -> Both:
    """The car and its logger with something wrong."""
    return both if hidden is None else _APPLY[hidden.cause](both, hidden.size)

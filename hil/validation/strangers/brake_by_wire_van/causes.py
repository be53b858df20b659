"""What can be wrong with the van, and which answers are right.

The actuators hold their own force sensors at the demand: a sensor that tells too much and a pad that bites less are the
same to all signals. So are the scale of the motor's torque and of its messages.
"""

from hil.validation.strangers.brake_by_wire_van.logger import Logger
from hil.validation.strangers.brake_by_wire_van.numbers import Numbers
from hil.validation.strangers.car import Cause, Hidden
from hil.validation.strangers.changes import Change, plus, times

Both = tuple[Numbers, Logger]
FRONT, FL, FR, RL, RR = (0, 1), (0,), (1,), (2,), (3,)


def _pads(*places: str) -> tuple[str, ...]:
    return tuple(f"{effect}@{at}" for at in places for effect in ("pad_mu_gain", "pressure_gain", "caliper_asymmetry"))


_ROWS: tuple[tuple[str, str, float, float, tuple[str, ...], Change], ...] = (
    ("front_pads", "", -0.12, -0.5, _pads("front"), times("gain_nm_pa", FRONT)),
    ("weak_corner", "", -0.03, -0.8, (*_pads("fr"), "stuck_corner@fr"),
     times("gain_nm_pa", FR)),
    ("pressure_scale", "", 0.015, 0.25, ("pressure_gain@rr",),
     plus("pressure_gain", RR)),
    ("dragging_brake", "N m", 3.0, 150.0, ("residual_drag@rl", "rolling_resistance@rl"),
     plus("drag_nm", RL)),
    ("slow_actuators", "", -0.65, -0.85, ("ehb_bandwidth", "fluid_temp"),
     times("emb_hz")),
    ("weak_motor", "", -0.08, -0.5, ("iwm_gain@rear", "wrong_scale@motor"),
     times("motor_gain")),
    ("slow_motor", "s", 0.06, 0.25, ("motor_tau",), plus("motor_s")),
    ("overloaded", "kg", 120.0, 1500.0, ("mass_offset",), plus("mass_kg")),
    ("rolling_resistance", "", 0.7, 2.5, ("rolling_resistance", "residual_drag"),
     times("rolling")),
    ("headwind", "m/s", 6.0, 15.0, ("headwind",), plus("wind_mps")),
    ("slope", "", 0.015, 0.06, ("road_grade",), plus("grade")),
    ("worn_tyre", "", -0.01, -0.05, ("tyre_radius@fl",),
     times("radius_m", FL)),
    ("crooked_steering", "rad", 0.001, 0.04, ("steer_lateral",),
     plus("toe_rad")),
    ("imu_scale", "", 0.06, 0.3, ("imu_gain", "wrong_scale@imu"),
     plus("ax_gain")),
    ("imu_zero", "m/s2", 0.2, 0.8, ("imu_bias", "imu_gain"),
     plus("ax_zero_mps2")),
)  # fmt: skip
CAUSES = {row[0]: Cause(row[0], row[1], row[2], row[3], frozenset(row[4])) for row in _ROWS}
_APPLY = {row[0]: row[5] for row in _ROWS}


def with_hidden(both: Both, hidden: Hidden | None) -> Both:
    """The van and its logger with something wrong."""
    return both if hidden is None else _APPLY[hidden.cause](both, hidden.size)

"""The car `dead_time`: a utility vehicle with motors in its wheels, on the logger of a proving ground.

It has no springs: a rigid body whose loads follow its accelerations through one pole of 0.1 s. Tyres follow a tanh of
the slips and have no relaxation. Motors have a dead time of 14 ms and a lag of 11 ms, the hydraulics a dead time of
22 ms, one pole of 40 ms and rates. A robot drives by time alone. The logger has rows of its own at 100 Hz: demands and
steering are exact at each, sensors are 8 to 13 ms old, each node by its own age, which nobody told the owner. Noise,
ages, small differences of the wheels, gusts and the road's grade are drawn for each drive, within what
docs/vehicle-set.md takes wheels to differ by. Discs begin each log at 350 K.

The owner states seventeen numbers with tolerances that hold, and that frames may be late; in every fourth drive six
numbers alone, each within a hundredth of the truth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil.validation.strangers.car import Cause, Hidden, Noise, Tolerated, Vector, Vehicle
from hil.validation.strangers.dead_time_log import (
    AX_ZERO_MPS2,
    GAIN_FRONT,
    GAIN_REAR,
    NODES,
    RADIUS_M,
    WHEEL_GAIN,
    WHEEL_MOTOR,
    WHEEL_PADS,
    WHEEL_RADIUS,
    WHEEL_ZERO_PA,
    WHEELS,
    YAW_ZERO_RAD_S,
    Drawn,
    draw,
    log,
)
from hil.validation.strangers.dead_time_motion import Numbers
from hil.validation.strangers.dead_time_script import scripts

TRUE = Numbers()
FRONT = np.array([1.0, 1.0, 0.0, 0.0])
STATED = {
    "mass_kg": 18.0, "wheelbase_m": 0.01, "cog_to_front_axle_m": 0.02, "rolling_radius_m": 0.0015,
    "brake_gain_front_nm_pa": 0.025 * GAIN_FRONT, "brake_gain_rear_nm_pa": 0.025 * GAIN_REAR,
    "cog_height_m": 0.03, "track_m": 0.02, "wheel_inertia_kg_m2": 0.15, "drag_coefficient": 0.02,
    "frontal_area_m2": 0.05, "rolling_resistance": 0.001, "yaw_inertia_kg_m2": 200.0, "steering_ratio": 0.5,
    "threshold_pressure_pa": 15e3, "motor_time_constant_s": 0.006, "ehb_dead_time_s": 0.005,
}  # fmt: skip
"""Half-widths that the owner states."""
SIX = tuple(STATED)[:6]
SIX_SHARE, SIX_WITHIN = 0.25, 0.01
LATENCY_TOLD_S = 0.015
USUAL = {
    "cog_height_m": 0.0795, "track_m": 0.02, "wheel_inertia_kg_m2": 0.45, "drag_coefficient": 0.09,
    "frontal_area_m2": 0.1, "rolling_resistance": 0.0044, "yaw_inertia_kg_m2": 585.0, "steering_ratio": 2.0,
    "threshold_pressure_pa": 5e4, "ehb_dead_time_s": 0.02, "air_density_kg_m3": 0.07,
    "slip_stiffness": 0.4 * TRUE.slip_stiffness, "cornering_stiffness": 0.4 * TRUE.cornering_stiffness,
    "tyre_friction": 0.2 * TRUE.tyre_friction, "lift_front": 0.05, "lift_rear": 0.05, "disc_front_j_k": 400.0,
    "ehb_pole_s": 0.02, "motor_dead_time_s": 0.006, "motor_lag_s": 0.006,
}  # fmt: skip
"""Half-widths of what is not stated: docs/vehicle-set.md; of the last three, a choice."""
LATE_S = 0.002  # of a node beside another: half of what docs/vehicle-set.md takes
_PADS = ("pad_mu_gain", "stuck_corner", "caliper_asymmetry")
"""Of pads that give too little: a share less, driven forward, is the same under each of these names."""


def _cause(name: str, unit: str, smallest: float, largest: float, *accepted: str) -> Cause:
    return Cause(name, unit, smallest, largest, frozenset(accepted))


CAUSES = {
    cause.name: cause
    for cause in (
        _cause("front_pads_weak", "1", -0.002, -0.6, *(f"{name}@front" for name in _PADS)),
        _cause("wheel_pads_weak", "1", -0.002, -0.6, *(f"{name}@fl" for name in _PADS)),
        _cause("front_pads_fade", "1/K", 2e-5, 4e-3, "pad_temp_fade@front"),
        _cause("brake_drags", "N m", 0.5, 200.0, "residual_drag@rr", "rolling_resistance@rr"),
        _cause("loaded", "kg", 5.0, 800.0, "mass_offset"),
        _cause("rear_motors_weak", "1", -0.002, -0.3, "iwm_gain@rear"),
        _cause("wheel_radius", "1", -1e-4, -0.05, "tyre_radius@fr"),
        _cause("accelerometer_zero", "m/s2", 0.005, 1.0, "imu_bias", "imu_gain"),
        _cause("accelerometer_scale", "1", 0.002, 0.2, "imu_gain", "wrong_scale@imu"),
        _cause("pressure_scale", "1", 0.002, 0.2, "pressure_gain@rl"),
        _cause("headwind", "m/s", 0.3, 20.0, "headwind"),
        _cause("friction_by_speed", "s/m", -1e-4, -0.01, "mu_speed@front"),
    )
}


class DeadTime:
    """The car and its drives (`hil.validation.strangers.car.StrangerCar`)."""

    name = "dead_time"
    causes: Mapping[str, Cause] = CAUSES

    def stated(self, rng: np.random.Generator) -> dict[str, float | list[float]]:
        """Seventeen numbers with tolerances, or six alone."""
        six = rng.random() < SIX_SHARE
        said: dict[str, float | list[float]] = {}
        for key, half in STATED.items():
            true = _true(key)
            half = SIX_WITHIN * true if six else half
            value = true + half * float(np.clip(0.5 * rng.standard_normal(), -1.0, 1.0))
            if key in SIX or not six:
                said[key] = float(f"{value:.4g}")
                if not six:
                    said[f"{key}_tolerance"] = float(f"{half:.3g}")
        if not six:
            said["node_latency_s_tolerance"] = LATENCY_TOLD_S
        return said

    def drive(
        self, seed: int, hidden: Hidden | None = None, noisy: bool = True, off: Tolerated | None = None
    ) -> list[dict[str, Vector]]:
        """Six logs; the script, the noise and all that a seed draws do not depend on what is hidden."""
        numbers, drawn = TRUE, draw(seed)
        if hidden is not None:
            numbers, drawn = _with_cause(numbers, drawn, hidden)
        if off is not None:
            numbers, drawn = _with_number(numbers, drawn, off)
        return [
            log(script, numbers, drawn, [seed, 3, k], noisy)
            for k, script in enumerate(scripts(np.random.default_rng([seed, 2])))
        ]

    def noise(self, seed: int) -> Noise:
        """Noise of that drive."""
        return draw(seed).noise

    def tolerated(self, stated: Vehicle) -> Sequence[Tolerated]:
        """Half of each half-width, what differs from wheel to wheel, ages of the nodes, zeros of the inertial unit."""
        halves = dict(USUAL)
        for key in STATED:
            if key in stated:
                told = stated.get(f"{key}_tolerance", SIX_WITHIN * _true(key))
                halves[key] = float(told) if not isinstance(told, list) else float(max(told))
        halves.pop("motor_time_constant_s", None)  # dead time and lag stand for it
        found = [Tolerated(key, 0.5 * half) for key, half in halves.items()]
        for what, size in (("radius", WHEEL_RADIUS), ("pads", WHEEL_PADS), ("motor", WHEEL_MOTOR),
                           ("pressure_scale", WHEEL_GAIN), ("pressure_zero", WHEEL_ZERO_PA)):  # fmt: skip
            found += [Tolerated(f"{what}_{w}", size) for w in WHEELS]
        found += [Tolerated(f"late_{node}", LATE_S) for node in NODES]
        return [*found, Tolerated("ax_zero", AX_ZERO_MPS2), Tolerated("yaw_zero", YAW_ZERO_RAD_S)]


def _true(key: str) -> float:
    own = {"rolling_radius_m": RADIUS_M, "brake_gain_front_nm_pa": GAIN_FRONT, "brake_gain_rear_nm_pa": GAIN_REAR,
           "motor_time_constant_s": TRUE.motor_dead_time_s + TRUE.motor_lag_s}  # fmt: skip
    return own[key] if key in own else float(getattr(TRUE, key))


def _with_cause(numbers: Numbers, drawn: Drawn, hidden: Hidden) -> tuple[Numbers, Drawn]:
    name, size, corners = hidden.cause, hidden.size, drawn.corners
    if name == "front_pads_weak":
        return numbers, _cornered(drawn, brake_gain_nm_pa=corners.brake_gain_nm_pa * (1.0 + size * FRONT))
    if name == "wheel_pads_weak":
        return numbers, _cornered(drawn, brake_gain_nm_pa=corners.brake_gain_nm_pa * (1.0 + size * _one("fl")))
    if name == "brake_drags":
        return numbers, _cornered(drawn, drag_nm=corners.drag_nm + size * _one("rr"))
    if name == "rear_motors_weak":
        return numbers, _cornered(drawn, motor_gain=corners.motor_gain * (1.0 + size * (1.0 - FRONT)))
    if name == "wheel_radius":
        return numbers, _cornered(drawn, radius_m=corners.radius_m * (1.0 + size * _one("fr")))
    if name == "accelerometer_zero":
        return numbers, replace(drawn, ax_zero_mps2=drawn.ax_zero_mps2 + size)
    if name == "accelerometer_scale":
        return numbers, replace(drawn, ax_scale=drawn.ax_scale * (1.0 + size))
    if name == "pressure_scale":
        return numbers, replace(drawn, pressure_scale=drawn.pressure_scale * (1.0 + size * _one("rl")))
    if name == "loaded":
        return numbers._replace(mass_kg=numbers.mass_kg + size), drawn
    field = {"front_pads_fade": "fade_front_1_k", "headwind": "wind_mps",
             "friction_by_speed": "friction_speed_front_s_m"}[name]  # fmt: skip
    return numbers._replace(**{field: size}), drawn


def _with_number(numbers: Numbers, drawn: Drawn, off: Tolerated) -> tuple[Numbers, Drawn]:
    name, by, corners = off.name, off.deviation, drawn.corners
    if name in Numbers._fields:
        return numbers._replace(**{name: getattr(numbers, name) + by}), drawn
    if name == "rolling_radius_m":
        return numbers, _cornered(drawn, radius_m=corners.radius_m + by)
    if name in ("brake_gain_front_nm_pa", "brake_gain_rear_nm_pa"):
        axle = FRONT if "front" in name else 1.0 - FRONT
        return numbers, _cornered(drawn, brake_gain_nm_pa=corners.brake_gain_nm_pa + by * axle)
    if name == "ax_zero":
        return numbers, replace(drawn, ax_zero_mps2=drawn.ax_zero_mps2 + by)
    if name == "yaw_zero":
        return numbers, replace(drawn, yaw_zero_rad_s=drawn.yaw_zero_rad_s + by)
    what, where = name.rsplit("_", 1)
    if what == "late":
        return numbers, replace(drawn, ages_s={**drawn.ages_s, where: drawn.ages_s[where] + by})
    if what == "pressure_zero":
        return numbers, replace(drawn, pressure_zero_pa=drawn.pressure_zero_pa + by * _one(where))
    factor = 1.0 + by * _one(where)
    if what == "pressure_scale":
        return numbers, replace(drawn, pressure_scale=drawn.pressure_scale * factor)
    field = {"radius": "radius_m", "pads": "brake_gain_nm_pa", "motor": "motor_gain"}[what]
    return numbers, _cornered(drawn, **{field: getattr(corners, field) * factor})


def _cornered(drawn: Drawn, **changed: Vector) -> Drawn:
    return replace(drawn, corners=drawn.corners._replace(**changed))


def _one(wheel: str) -> Vector:
    return np.array([float(w == wheel) for w in WHEELS])

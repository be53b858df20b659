"""The car `dead_time`: a utility vehicle with motors in its wheels, on the logger of a proving ground.

It has no springs: a rigid body whose loads follow its accelerations through one pole of 0.1 s. Tyres follow a tanh of
the slips and have no relaxation. Motors have a dead time of 14 ms and a lag of 11 ms, the hydraulics a dead time of
22 ms, one pole of 40 ms and rates. A robot drives by time alone. The logger has rows of its own at 100 Hz: demands and
steering are exact at each, sensors are 8 to 13 ms old, each node by its own age, which nobody told the owner. Noise,
ages, small differences of the wheels, gusts and the road's grade are drawn for each drive, within what
docs/vehicle-set.md takes wheels to differ by. Discs begin each log at 350 K.

The owner states seventeen numbers with tolerances that hold, and in half of these drives knows that frames may be late;
in every fourth drive six numbers alone, each within a hundredth of the truth. The dead time of the motors has no key:
their lag alone is told.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil.validation.strangers.car import Cause, Hidden, Noise, Tolerated, Vector, Vehicle
from hil.validation.strangers.dead_time.log import (
    AX_SCALE,
    AX_ZERO_MPS2,
    GAIN_FRONT,
    GAIN_REAR,
    GROUND_SCALE,
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
    another_day,
    draw,
    log,
)
from hil.validation.strangers.dead_time.motion import Numbers
from hil.validation.strangers.dead_time.script import scripts

TRUE = Numbers()
STATED = {
    "mass_kg": 18.0, "wheelbase_m": 0.01, "cog_to_front_axle_m": 0.02, "rolling_radius_m": 0.0015,
    "brake_gain_front_nm_pa": 0.025 * GAIN_FRONT, "brake_gain_rear_nm_pa": 0.025 * GAIN_REAR,
    "cog_height_m": 0.03, "track_m": 0.02, "wheel_inertia_kg_m2": 0.15, "drag_coefficient": 0.02,
    "frontal_area_m2": 0.05, "rolling_resistance": 0.001, "yaw_inertia_kg_m2": 200.0, "steering_ratio": 0.5,
    "threshold_pressure_pa": 15e3, "motor_time_constant_s": 0.003, "ehb_dead_time_s": 0.005,
}  # fmt: skip
"""Half-widths that the owner states."""
SIX = tuple(STATED)[:6]
SIX_SHARE, SIX_WITHIN, LATE_SHARE = 0.25, 0.01, 0.5
LATENCY_TOLD_S = 0.015
USUAL = {
    "cog_height_m": 0.0795, "track_m": 0.02, "wheel_inertia_kg_m2": 0.45, "drag_coefficient": 0.09,
    "frontal_area_m2": 0.1, "rolling_resistance": 0.0044, "yaw_inertia_kg_m2": 585.0, "steering_ratio": 2.0,
    "threshold_pressure_pa": 5e4, "ehb_dead_time_s": 0.02, "air_density_kg_m3": 0.07,
    "slip_stiffness": 0.4 * TRUE.slip_stiffness, "cornering_stiffness": 0.4 * TRUE.cornering_stiffness,
    "tyre_friction": 0.2 * TRUE.tyre_friction, "lift_front": 0.05, "lift_rear": 0.05,
    "ehb_pole_s": 0.02, "motor_dead_time_s": 0.006, "motor_lag_s": 0.006,
}  # fmt: skip
"""Half-widths of what is not stated: docs/vehicle-set.md; of the last three, a choice."""
LATE_S, GROUND_LATE_S = 0.01, 0.1
UNLIKE = {
    "pads": WHEEL_PADS, "radius": WHEEL_RADIUS, "motor": WHEEL_MOTOR, "pressure_scale": WHEEL_GAIN,
    "pressure_zero": WHEEL_ZERO_PA,
}  # fmt: skip
UNTOLD = {
    "ax_zero_mps2": AX_ZERO_MPS2, "ax_scale": AX_SCALE, "yaw_zero_rad_s": YAW_ZERO_RAD_S, "ground_scale": GROUND_SCALE,
    "motor_all": 0.015, "grade": 0.0025, "wind_mps": 1.0,
}  # fmt: skip
"""What nobody states and everybody knows as well as this (one standard deviation), as the stamps above."""
WHERE = {
    **{w: np.array([float(w == own) for own in WHEELS]) for w in WHEELS},
    "front": np.array([1.0, 1.0, 0.0, 0.0]), "rear": np.array([0.0, 0.0, 1.0, 1.0]),
}  # fmt: skip
CORNERS = {"pads": "brake_gain_nm_pa", "radius": "radius_m", "motor": "motor_gain"}
AS_SHARE = {
    "rolling_radius_m": "radius_all", "brake_gain_front_nm_pa": "pads_front", "brake_gain_rear_nm_pa": "pads_rear",
}  # fmt: skip
"""Stated numbers that are changed by a share."""
CHANGES = {
    "front_pads_weak": "pads_front", "wheel_pads_weak": "pads_fl", "front_pads_fade": "fade_front_1_k",
    "brake_drags": "drag_rr", "loaded": "mass_kg", "rear_motors_weak": "motor_rear", "wheel_radius": "radius_fr",
    "accelerometer_zero": "ax_zero_mps2", "accelerometer_scale": "ax_scale", "pressure_scale": "pressure_scale_rl",
    "headwind": "wind_mps", "friction_by_speed": "friction_speed_front_s_m",
}  # fmt: skip
"""What of the car each cause changes."""
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
        six, late = rng.random() < SIX_SHARE, rng.random() < LATE_SHARE
        said: dict[str, float | list[float]] = {}
        for key, half in STATED.items():
            true = _true(key)
            half = SIX_WITHIN * true if six else half
            value = true + half * float(np.clip(0.5 * rng.standard_normal(), -1.0, 1.0))
            if key in SIX or not six:
                said[key] = float(f"{value:.5g}")
                if not six:
                    said[f"{key}_tolerance"] = float(f"{half:.3g}")
        if late and not six:
            said["node_latency_s_tolerance"] = LATENCY_TOLD_S
        return said

    def drive(
        self, seed: int, hidden: Hidden | None = None, noisy: bool = True, off: Tolerated | None = None,
        day: int | None = None,
    ) -> list[dict[str, Vector]]:  # fmt: skip
        """Six logs; the script, the noise and all that a seed draws do not depend on what is hidden."""
        numbers, drawn = TRUE, draw(seed) if day is None else another_day(seed, day)
        if hidden is not None:
            numbers, drawn = _changed(numbers, drawn, CHANGES[hidden.cause], hidden.size)
        if off is not None:
            numbers, drawn = _changed(numbers, drawn, off.name, off.deviation)
        driven = seed if day is None else day
        return [
            log(script, numbers, drawn, [driven, 3, k], noisy)
            for k, script in enumerate(scripts(np.random.default_rng([driven, 2])))
        ]

    def noise(self, seed: int) -> Noise:
        """Noise of that drive."""
        return draw(seed).noise

    def tolerated(self, stated: Vehicle) -> Sequence[Tolerated]:
        """Half of each half-width; what differs from wheel to wheel; how well sensors, stamps and road are known."""
        halves = dict(USUAL)
        for key in STATED:
            if key in stated:
                told = stated.get(f"{key}_tolerance", SIX_WITHIN * _true(key))
                halves[key] = float(told) if not isinstance(told, list) else float(max(told))
        halves["motor_lag_s"] = halves.pop("motor_time_constant_s", USUAL["motor_lag_s"])
        found = [
            Tolerated(AS_SHARE.get(key, key), 0.5 * half / (_true(key) if key in AS_SHARE else 1.0))
            for key, half in halves.items()
        ]
        found += [Tolerated(f"{what}_{w}", size) for what, size in UNLIKE.items() for w in WHEELS]
        found += [Tolerated(f"late_{node}", GROUND_LATE_S if node == "ground" else LATE_S) for node in NODES]
        return found + [Tolerated(name, size) for name, size in UNTOLD.items()]


def _true(key: str) -> float:
    own = {"rolling_radius_m": RADIUS_M, "brake_gain_front_nm_pa": GAIN_FRONT, "brake_gain_rear_nm_pa": GAIN_REAR,
           "motor_time_constant_s": TRUE.motor_lag_s}  # fmt: skip
    return own[key] if key in own else float(getattr(TRUE, key))


def _changed(numbers: Numbers, drawn: Drawn, what: str, by: float) -> tuple[Numbers, Drawn]:
    """The car with one thing changed: a number by so much, or ``thing_where`` of wheels and nodes, by a share."""
    if what in Numbers._fields:
        return numbers._replace(**{what: getattr(numbers, what) + by}), drawn
    corners = drawn.corners
    thing, where = what.rsplit("_", 1)
    at = WHERE.get(where, np.ones(4))
    if thing == "late":
        return numbers, replace(drawn, ages_s={**drawn.ages_s, where: drawn.ages_s[where] + by})
    if thing == "pressure_zero":
        return numbers, replace(drawn, pressure_zero_pa=drawn.pressure_zero_pa + by * at)
    if thing == "pressure_scale":
        return numbers, replace(drawn, pressure_scale=drawn.pressure_scale * (1.0 + by * at))
    if thing == "drag":
        return numbers, replace(drawn, corners=corners._replace(drag_nm=corners.drag_nm + by * at))
    if thing in CORNERS:
        field = CORNERS[thing]
        return numbers, replace(drawn, corners=corners._replace(**{field: getattr(corners, field) * (1.0 + by * at)}))
    return numbers, replace(drawn, **{what: getattr(drawn, what) + by})

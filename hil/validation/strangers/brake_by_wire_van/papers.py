"""What the van's owner writes, and what nobody knows exactly."""

from collections.abc import Mapping

import numpy as np

from hil.validation.strangers.brake_by_wire_van import numbers as n
from hil.validation.strangers.brake_by_wire_van.logger import Logger
from hil.validation.strangers.brake_by_wire_van.numbers import WHEELS, Numbers
from hil.validation.strangers.car import Tolerated, Vehicle
from hil.validation.strangers.changes import Change, plus

FEW_KEYS = 0.3
"""Share of the owners who write what a van has unlike a car, and no more."""
Both = tuple[Numbers, Logger]
REAR_TURNING_KG_M2 = n.REAR_INERTIA_KG_M2 + 0.5 * n.ROTOR_KG_M2


def stated(rng: np.random.Generator) -> dict[str, float | list[float]]:
    """The vehicle set: the six keys and what the usual values of a car are wrong for, or six to nine more."""
    found: dict[str, float | list[float]] = {
        "mass_kg": n.MASS_KG, "mass_kg_tolerance": 40.0, "wheelbase_m": n.WHEELBASE_M,
        "cog_to_front_axle_m": n.FRONT_M, "cog_to_front_axle_m_tolerance": 0.03,
        "rolling_radius_m": n.RADIUS_M, "rolling_radius_m_tolerance": 0.002,
        "brake_gain_front_nm_pa": n.FRONT_GAIN_NM_PA, "brake_gain_front_nm_pa_tolerance": 1e-5,
        "brake_gain_rear_nm_pa": n.REAR_GAIN_NM_PA, "brake_gain_rear_nm_pa_tolerance": 6e-6,
        "cog_height_m": n.HEIGHT_M, "cog_height_m_tolerance": 0.06,
        "drag_coefficient": n.DRAG, "drag_coefficient_tolerance": 0.03, "frontal_area_m2": n.AREA_M2,
        "wheel_inertia_kg_m2": [n.FRONT_INERTIA_KG_M2, REAR_TURNING_KG_M2], "wheel_inertia_kg_m2_tolerance": 0.35,
        "yaw_inertia_kg_m2": n.YAW_KG_M2, "yaw_inertia_kg_m2_tolerance": 900.0, "track_m": [1.74, 1.71],
    }  # fmt: skip
    if rng.random() < FEW_KEYS:
        return found
    found |= {
        "rolling_resistance": n.ROLLING,
        "rolling_resistance_tolerance": 0.002,
        "steering_ratio": n.RATIO,
        "steering_ratio_tolerance": 0.4,
        "node_latency_s_tolerance": 0.02,
    }
    if rng.random() < 0.6:
        found |= {
            "ehb_natural_frequency_hz": n.EMB_HZ, "ehb_natural_frequency_hz_tolerance": 1.2,
            "ehb_damping_ratio": n.EMB_DAMPING, "ehb_damping_ratio_tolerance": 0.15,
            "ehb_dead_time_s": 1e-3 * n.EMB_DEAD_MS, "ehb_dead_time_s_tolerance": 0.02,
            "motor_time_constant_s": n.MOTOR_S + 1e-3 * n.MOTOR_DEAD_MS, "motor_time_constant_s_tolerance": 0.02,
        }  # fmt: skip
    return found


TOLERATED: Mapping[str, tuple[float, Change]] = {
    "mass": (20.0, plus("mass_kg")), "cog_height": (0.03, plus("height_m")),
    "front_axle": (0.015, plus("to_axle_m", (0,))), "radius": (0.001, plus("radius_m")),
    "front_inertia": (0.12, plus("wheel_inertia_kg_m2", (0, 1))),
    "rear_inertia": (0.12, plus("wheel_inertia_kg_m2", (2, 3))), "drag": (0.04, plus("drag_kg_m")),
    "rolling": (1e-3, plus("rolling")), "front_pads": (5e-6, plus("gain_nm_pa", (0, 1))),
    "rear_pads": (3e-6, plus("gain_nm_pa", (2, 3))), "stiffness": (2.5, plus("stiffness")),
    "relaxation": (0.1, plus("length_m")), "cornering": (1.6, plus("cornering")),
    "friction": (0.07, plus("friction")), "pad_speed_loss": (0.008, plus("pad_speed_loss")),
    "steering_ratio": (0.2, plus("steering_ratio")), "yaw_inertia": (450.0, plus("yaw_inertia_kg_m2")),
    "dive": (4e-4, plus("dive_rad_s2_m")), "roll": (1.2e-3, plus("roll_rad_s2_m")),
    "transfer": (0.015, plus("transfer_s")), "toe": (3e-4, plus("toe_rad")),
    "grade": (0.0025, plus("grade")), "wind": (1.0, plus("wind_mps")),
    "emb_frequency": (0.6, plus("emb_hz")), "emb_damping": (0.075, plus("emb_damping")),
    "emb_dead_time": (8.0, plus("emb_dead_ms")), "clearance": (8.0, plus("clearance_ms")),
    "dead_band": (2e4, plus("dead_band_pa")), "motor_gain": (0.015, plus("motor_gain")),
    "motor_time": (0.006, plus("motor_s")), "motor_dead_time": (6.0, plus("motor_dead_ms")),
    "imu_age": (0.01, plus("imu_age_s")), "wheel_age": (0.01, plus("wheel_age_s")),
    "pressure_age": (0.01, plus("pressure_age_s")), "motor_age": (0.01, plus("motor_age_s")),
    "ax_zero": (0.025, plus("ax_zero_mps2")), "ay_zero": (0.025, plus("ay_zero_mps2")),
    "ax_gain": (0.01, plus("ax_gain")), "yaw_zero": (1e-3, plus("yaw_zero_rad_s")),
    "steer_zero": (0.0087, plus("steer_zero_rad")),
    **{f"pads_{w}": (1.5e-6, plus("gain_nm_pa", (i,))) for i, w in enumerate(WHEELS)},
    **{f"radius_{w}": (3.5e-4, plus("radius_m", (i,))) for i, w in enumerate(WHEELS)},
    **{f"threshold_{w}": (1.5e4, plus("threshold_pa", (i,))) for i, w in enumerate(WHEELS)},
    **{f"pressure_zero_{w}": (7e3, plus("pressure_zero_pa", (i,))) for i, w in enumerate(WHEELS)},
    **{f"pressure_gain_{w}": (5e-3, plus("pressure_gain", (i,))) for i, w in enumerate(WHEELS)},
}  # fmt: skip
"""Name -> one standard deviation, and how the number goes off."""
BY_KEY = {
    "rolling": ("rolling_resistance", 1.0, 0.0022),
    "steering_ratio": ("steering_ratio", 1.0, 1.0),
    "emb_frequency": ("ehb_natural_frequency_hz", 1.0, 2.4),
    "emb_damping": ("ehb_damping_ratio", 1.0, 0.36),
    "emb_dead_time": ("ehb_dead_time_s", 1e3, 0.01),
    "motor_dead_time": ("motor_time_constant_s", 1e3, 0.01),
}
"""Name -> the key that owners may state it by, its size per that of the key, and one standard deviation of the key
where it is not stated (docs/vehicle-set.md)."""


def tolerated(stated_numbers: Vehicle) -> list[Tolerated]:
    """Numbers that nobody knows exactly beside a set: half the stated tolerance, or as usually known."""
    found = {name: deviation for name, (deviation, _) in TOLERATED.items()}
    for name, (key, share, usual) in BY_KEY.items():
        told = stated_numbers.get(f"{key}_tolerance")
        found[name] = share * (usual if told is None else 0.5 * float(np.max(told)))
    return [Tolerated(name, deviation) for name, deviation in found.items()]


def with_off(both: Both, off: Tolerated | None) -> Both:
    """The van with one of its numbers off."""
    return both if off is None else TOLERATED[off.name][1](both, off.deviation)

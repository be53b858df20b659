"""What the saloon's owner writes, and what nobody knows exactly."""

from collections.abc import Mapping

import numpy as np

from hil.validation.strangers.car import Tolerated, Vehicle
from hil.validation.strangers.changes import Change, plus
from hil.validation.strangers.hydraulic_saloon import numbers as n
from hil.validation.strangers.hydraulic_saloon.brakes import drum_factor
from hil.validation.strangers.hydraulic_saloon.logger import Logger
from hil.validation.strangers.hydraulic_saloon.numbers import WHEELS, Numbers

FEW_KEYS = 0.3
"""Share of the owners who write the six keys alone."""
Both = tuple[Numbers, Logger]
FRONT_GAIN_NM_PA = 2.0 * n.MU * float(n.PISTON_M2[0] * n.BRAKE_RADIUS_M[0]) * n.EFFICIENCY
REAR_GAIN_NM_PA = float(drum_factor(n.MU) * n.PISTON_M2[2] * n.BRAKE_RADIUS_M[2]) * n.EFFICIENCY


def stated(rng: np.random.Generator) -> dict[str, float | list[float]]:
    """The vehicle set: six keys, or those and six to nine more."""
    found: dict[str, float | list[float]] = {
        "mass_kg": n.MASS_KG, "mass_kg_tolerance": 20.0, "wheelbase_m": n.WHEELBASE_M,
        "cog_to_front_axle_m": n.FRONT_M, "cog_to_front_axle_m_tolerance": 0.02,
        "rolling_radius_m": n.RADIUS_M, "rolling_radius_m_tolerance": 0.002,
        "brake_gain_front_nm_pa": float(f"{FRONT_GAIN_NM_PA:.3g}"), "brake_gain_front_nm_pa_tolerance": 8e-6,
        "brake_gain_rear_nm_pa": float(f"{REAR_GAIN_NM_PA:.3g}"), "brake_gain_rear_nm_pa_tolerance": 4e-6,
    }  # fmt: skip
    if rng.random() < FEW_KEYS:
        return found
    found |= {
        "cog_height_m": n.HEIGHT_M, "cog_height_m_tolerance": 0.03,
        "drag_coefficient": n.DRAG, "drag_coefficient_tolerance": 0.02, "frontal_area_m2": n.AREA_M2,
        "rolling_resistance": n.ROLLING, "rolling_resistance_tolerance": 0.0025,
        "wheel_inertia_kg_m2": n.INERTIA_KG_M2, "wheel_inertia_kg_m2_tolerance": 0.2,
    }  # fmt: skip
    more: list[dict[str, float | list[float]]] = [
        {"track_m": [1.528, 1.516]}, {"steering_ratio": n.RATIO, "steering_ratio_tolerance": 0.4},
        {"yaw_inertia_kg_m2": n.YAW_KG_M2, "yaw_inertia_kg_m2_tolerance": 220.0},
        {"node_latency_s_tolerance": 0.03}, {"line_lag_s_tolerance": 0.03},
        {"air_density_kg_m3": n.AIR_KG_M3, "air_density_kg_m3_tolerance": 0.03},
        {"ambient_k": 293.0, "ambient_k_tolerance": 6.0},
    ]  # fmt: skip
    for k in rng.permutation(len(more))[: int(rng.integers(1, 5))]:
        found |= more[k]
    return found


TOLERATED: Mapping[str, tuple[float, Change]] = {
    "mass": (10.0, plus("mass_kg")), "cog_height": (0.0125, plus("height_m")),
    "front_axle": (0.01, plus("to_axle_m", (0,))), "radius": (0.001, plus("radius_m")),
    "wheel_inertia": (0.07, plus("wheel_inertia_kg_m2")), "drag": (0.016, plus("drag_kg_m")),
    "rolling": (8e-4, plus("rolling")), "front_pads": (0.0075, plus("mu", (0, 1))),
    "rear_linings": (0.0075, plus("mu", (2, 3))), "stiffness": (3.0, plus("stiffness")),
    "relaxation": (0.08, plus("length_m")), "cornering": (2.0, plus("cornering")),
    "friction": (0.08, plus("friction")), "pad_speed_loss": (0.01, plus("pad_speed_loss")),
    "steering_ratio": (0.2, plus("steering_ratio")), "yaw_inertia": (110.0, plus("yaw_inertia_kg_m2")),
    "dive": (3e-4, plus("dive_rad_s2_m")), "roll": (1e-3, plus("roll_rad_s2_m")),
    "transfer": (0.02, plus("transfer_s")), "toe": (3e-4, plus("toe_rad")),
    "grade": (0.0025, plus("grade")), "wind": (1.0, plus("wind_mps")),
    "imu_age": (0.01, plus("imu_age_s")), "wheel_age": (0.01, plus("wheel_age_s")),
    "pressure_age": (0.01, plus("pressure_age_s")), "speed_age": (0.1, plus("speed_age_s")),
    "ax_zero": (0.025, plus("ax_zero_mps2")), "ay_zero": (0.025, plus("ay_zero_mps2")),
    "ax_gain": (0.01, plus("ax_gain")), "yaw_zero": (1e-3, plus("yaw_zero_rad_s")),
    "steer_zero": (0.0087, plus("steer_zero_rad")), "speed_gain": (0.005, plus("speed_gain")),
    **{f"pads_{w}": (0.003, plus("mu", (i,))) for i, w in enumerate(WHEELS)},
    **{f"radius_{w}": (3e-4, plus("radius_m", (i,))) for i, w in enumerate(WHEELS)},
    **{f"threshold_{w}": (1.5e4, plus("threshold_pa", (i,))) for i, w in enumerate(WHEELS)},
    **{f"pressure_zero_{w}": (7e3, plus("pressure_zero_pa", (i,))) for i, w in enumerate(WHEELS)},
}  # fmt: skip
"""Name -> one standard deviation, and how the number goes off."""
BY_KEY = {
    "cog_height": ("cog_height_m", 1.0, 0.04),
    "drag": ("drag_coefficient", 0.5 * n.AIR_KG_M3 * n.AREA_M2, 0.045),
    "rolling": ("rolling_resistance", 1.0, 0.0022),
    "wheel_inertia": ("wheel_inertia_kg_m2", 1.0, 0.22),
    "yaw_inertia": ("yaw_inertia_kg_m2", 1.0, 290.0),
    "steering_ratio": ("steering_ratio", 1.0, 1.0),
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
    """The car with one of its numbers off."""
    return both if off is None else TOLERATED[off.name][1](both, off.deviation)

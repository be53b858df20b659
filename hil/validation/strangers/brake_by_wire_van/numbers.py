"""Numbers of the van: what its papers say with the load they state, and the van that is driven."""

from typing import NamedTuple

import numpy as np

from hil.validation.strangers.car import DAY_SHARE
from hil.validation.strangers.signals import Vector

WHEELS = ("fl", "fr", "rl", "rr")


class Numbers(NamedTuple):
    """Everything that the equations take; wheels in the order of `WHEELS`, axles front first.

    Attributes
    ----------
    rotor_kg_m2 : the motor's inertia at the wheels: it turns with the mean of the rear wheels.
    gain_nm_pa : brake torque per pressure above the threshold.  pad_speed_loss : share lost at 30 m/s.
    emb_hz, emb_damping, emb_dead_ms, clearance_ms : clamping force; the time that the pads take to the disc.
    dead_band_pa : demands below it are not answered.
    motor_gain : true torque over the told one.  motor_s, motor_dead_ms : of the torque.
    roll_hz, roll_damping : of the body; loads across follow it.  transfer_s : of the loads along.
    grade, wind_mps : of the whole drive; the wind is positive against the van.
    toe_rad : angle of the front wheels where the steering wheel stands straight.
    """

    mass_kg: float
    yaw_inertia_kg_m2: float
    to_axle_m: Vector
    height_m: float
    track_m: Vector
    steering_ratio: float
    radius_m: Vector
    wheel_inertia_kg_m2: Vector
    rotor_kg_m2: float
    drag_kg_m: float
    rolling: Vector
    drag_nm: Vector
    stiffness: float
    cornering: float
    friction: float
    length_m: float
    side_length_m: float
    gain_nm_pa: Vector
    threshold_pa: Vector
    pad_speed_loss: float
    emb_hz: Vector
    emb_damping: float
    emb_dead_ms: float
    clearance_ms: Vector
    dead_band_pa: float
    motor_gain: float
    motor_s: float
    motor_dead_ms: float
    roll_hz: float
    roll_damping: float
    transfer_s: float
    dive_rad_s2_m: float
    roll_rad_s2_m: float
    grade: float
    wind_mps: float
    toe_rad: float


MASS_KG, WHEELBASE_M, FRONT_M, HEIGHT_M = 3150.0, 3.30, 1.76, 0.79
RADIUS_M, FRONT_INERTIA_KG_M2, REAR_INERTIA_KG_M2, ROTOR_KG_M2 = 0.347, 2.25, 2.4, 2.6
YAW_KG_M2, RATIO, DRAG, AREA_M2, AIR_KG_M3, ROLLING = 7200.0, 17.4, 0.36, 4.25, 1.2, 0.0108
FRONT_GAIN_NM_PA, REAR_GAIN_NM_PA = 2.5e-4, 1.5e-4
EMB_HZ, EMB_DAMPING, EMB_DEAD_MS, MOTOR_S, MOTOR_DEAD_MS = 5.5, 0.8, 45.0, 0.022, 25.0
RADIUS_SHARE, PADS_SHARE = 0.0008, 0.008
"""By how much wheels differ, one standard deviation."""


def true_numbers(rng: np.random.Generator) -> Numbers:
    """The van of one seed: within the tolerances of `hil.validation.strangers.brake_by_wire_van.papers`."""

    def near(value: float, tolerance: float) -> float:
        """Around a value, a tolerance being two standard deviations and the most."""
        return value + tolerance * float(np.clip(rng.normal(0.0, 0.5), -1.0, 1.0))

    def four(deviation: float) -> Vector:
        return np.asarray(rng.normal(0.0, deviation, 4).clip(-2.0 * deviation, 2.0 * deviation))

    front_m, radius = near(FRONT_M, 0.03), near(RADIUS_M, 0.002)
    front, rear = near(FRONT_GAIN_NM_PA, 0.8e-5), near(REAR_GAIN_NM_PA, 0.5e-5)
    return Numbers(
        mass_kg=near(MASS_KG, 40.0), yaw_inertia_kg_m2=near(YAW_KG_M2, 700.0),
        to_axle_m=np.array([front_m, WHEELBASE_M - front_m]), height_m=near(HEIGHT_M, 0.05),
        track_m=np.array([1.74, 1.71]), steering_ratio=near(RATIO, 0.35), radius_m=radius * (1.0 + four(RADIUS_SHARE)),
        wheel_inertia_kg_m2=np.repeat([near(FRONT_INERTIA_KG_M2, 0.15), near(REAR_INERTIA_KG_M2, 0.15)], 2),
        rotor_kg_m2=near(ROTOR_KG_M2, 0.2), drag_kg_m=0.5 * near(AIR_KG_M3, 0.03) * near(DRAG, 0.02) * AREA_M2,
        rolling=np.full(4, near(ROLLING - 0.0006, 0.0012)), drag_nm=1.0 + 1.5 * rng.random(4),
        stiffness=near(17.0, 2.5), cornering=near(12.0, 1.5), friction=near(0.95, 0.07),
        length_m=near(0.42, 0.1), side_length_m=near(0.75, 0.15),
        gain_nm_pa=np.repeat([front, rear], 2) * (1.0 + four(PADS_SHARE)), threshold_pa=5e4 + four(1e4),
        pad_speed_loss=rng.uniform(0.0, 0.02), emb_hz=np.full(4, near(EMB_HZ, 0.6)) * (1.0 + four(0.02)),
        emb_damping=near(EMB_DAMPING, 0.08), emb_dead_ms=near(EMB_DEAD_MS, 12.0),
        clearance_ms=rng.uniform(10.0, 35.0, 4),
        dead_band_pa=rng.uniform(0.8e5, 1.6e5), motor_gain=1.0 + float(rng.normal(0.0, 0.008)),
        motor_s=near(MOTOR_S, 0.006), motor_dead_ms=near(MOTOR_DEAD_MS, 8.0), roll_hz=rng.uniform(1.3, 1.7),
        roll_damping=rng.uniform(0.28, 0.4), transfer_s=rng.uniform(0.03, 0.06),
        dive_rad_s2_m=rng.uniform(1.2, 1.8) * 0.00178, roll_rad_s2_m=rng.uniform(4.5, 6.5) * 0.00178,
        grade=0.0, wind_mps=0.0, toe_rad=float(rng.normal(0.0, 0.0003)),
    )  # fmt: skip


def wheels_another_day(car: Numbers, rng: np.random.Generator) -> Numbers:
    """The same car on another day: radius and pads of single wheels off by `DAY_SHARE` of what wheels differ by."""
    radius, pads = (1.0 + DAY_SHARE * share * rng.standard_normal(4) for share in (RADIUS_SHARE, PADS_SHARE))
    return car._replace(radius_m=car.radius_m * radius, gain_nm_pa=car.gain_nm_pa * pads)

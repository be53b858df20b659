"""Numbers of the saloon: what its papers say, and the car that stands in the yard."""

from typing import NamedTuple

import numpy as np

from hil.validation.strangers.car import DAY_SHARE
from hil.validation.strangers.signals import Vector

WHEELS = ("fl", "fr", "rl", "rr")


class Numbers(NamedTuple):
    """Everything that the equations take; wheels in the order of `WHEELS`, axles front first.

    Attributes
    ----------
    pad_speed_loss : share of the friction lost at 30 m/s.
    cold_loss : share of the friction lost at 100 K below 423 K.  mu_exponent : of the pressure over 30 bar, negative.
    gearbox_nm, gearbox_nms : drag of the gearbox at each front wheel, and its rise per rad/s.
    held_pa : pressure that a calliper keeps.  judder : share of the torque at the first order.
    grade, wind_mps : of the whole drive; the wind is positive against the car.
    dive_rad_s2_m, roll_rad_s2_m : angle of the body per acceleration.  transfer_s : of the load.
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
    drag_kg_m: float
    lift_kg_m: Vector
    rolling: Vector
    drag_nm: Vector
    gearbox_nm: float
    gearbox_nms: float
    stiffness: float
    cornering: Vector
    friction: float
    length_m: float
    side_length_m: float
    piston_m2: Vector
    radius_brake_m: Vector
    efficiency: float
    mu: Vector
    threshold_pa: Vector
    pad_speed_loss: float
    cold_loss: Vector
    mu_exponent: Vector
    held_pa: Vector
    judder: Vector
    knee_pa: float
    valve_slope: float
    booster_s: float
    line_s: Vector
    heat_j_k: Vector
    cooling_w_k: Vector
    ambient_k: float
    grade: float
    wind_mps: float
    dive_rad_s2_m: float
    roll_rad_s2_m: float
    transfer_s: float
    toe_rad: float


MASS_KG, WHEELBASE_M, FRONT_M, HEIGHT_M = 1438.0, 2.682, 1.118, 0.552
RADIUS_M, INERTIA_KG_M2, YAW_KG_M2, RATIO = 0.3045, 1.28, 2230.0, 15.6
DRAG, AREA_M2, AIR_KG_M3, ROLLING = 0.305, 2.17, 1.19, 0.0117
MU, EFFICIENCY = 0.37, 0.96
PISTON_M2 = np.array([2.29e-3, 2.29e-3, 3.464e-4, 3.464e-4])
BRAKE_RADIUS_M = np.array([0.1135, 0.1135, 0.1143, 0.1143])
RADIUS_SHARE, PADS_SHARE = 0.0008, 0.008
"""By how much wheels differ, one standard deviation."""


def true_numbers(rng: np.random.Generator) -> Numbers:
    """The car of one seed: within the tolerances of `hil.validation.strangers.hydraulic_saloon.papers`."""

    def near(value: float, tolerance: float) -> float:
        """Around a value, a tolerance being two standard deviations and the most."""
        return value + tolerance * float(np.clip(rng.normal(0.0, 0.5), -1.0, 1.0))

    def four(deviation: float) -> Vector:
        return np.asarray(rng.normal(0.0, deviation, 4).clip(-2.0 * deviation, 2.0 * deviation))

    front_m = near(FRONT_M, 0.02)
    radius = near(RADIUS_M, 0.002)
    front_mu, rear_mu = near(MU, 0.011), near(MU, 0.011)
    air = near(AIR_KG_M3, 0.02)
    tyre_rolling = near(0.0098, 0.001)
    return Numbers(
        mass_kg=near(MASS_KG, 20.0), yaw_inertia_kg_m2=near(YAW_KG_M2, 180.0),
        to_axle_m=np.array([front_m, WHEELBASE_M - front_m]), height_m=near(HEIGHT_M, 0.025),
        track_m=np.array([1.528, 1.516]), steering_ratio=near(RATIO, 0.3),
        radius_m=radius * (1.0 + four(RADIUS_SHARE)),
        wheel_inertia_kg_m2=near(INERTIA_KG_M2, 0.1) * np.array([1.05, 1.05, 0.95, 0.95]),
        drag_kg_m=0.5 * air * near(DRAG, 0.015) * AREA_M2, lift_kg_m=0.5 * air * AREA_M2 * np.array([0.04, 0.09]),
        rolling=np.full(4, tyre_rolling), drag_nm=1.2 + 0.8 * rng.random(4), gearbox_nm=1.5, gearbox_nms=0.012,
        stiffness=near(21.0, 3.0), cornering=np.array([14.5, 17.5]) * near(1.0, 0.1), friction=near(1.02, 0.06),
        length_m=near(0.28, 0.08), side_length_m=near(0.5, 0.1),
        piston_m2=PISTON_M2, radius_brake_m=BRAKE_RADIUS_M, efficiency=EFFICIENCY,
        mu=np.array([front_mu, front_mu, rear_mu, rear_mu]) * (1.0 + four(PADS_SHARE)),
        threshold_pa=np.array([4e4, 4e4, 7e4, 7e4]) + four(5e3), pad_speed_loss=rng.uniform(0.03, 0.06),
        cold_loss=np.zeros(4), mu_exponent=np.zeros(4), held_pa=np.zeros(4), judder=np.zeros(4),
        knee_pa=near(2.6e6, 2e5), valve_slope=near(0.37, 0.03), booster_s=rng.uniform(0.05, 0.09),
        line_s=np.array([rng.uniform(0.012, 0.022), rng.uniform(0.02, 0.035)]),
        heat_j_k=np.array([3100.0, 3100.0, 4300.0, 4300.0]), cooling_w_k=np.array([14.0, 14.0, 9.0, 9.0]),
        ambient_k=near(293.0, 5.0), grade=0.0, wind_mps=0.0,
        dive_rad_s2_m=rng.uniform(0.9, 1.4) * 0.00178, roll_rad_s2_m=rng.uniform(3.5, 5.0) * 0.00178,
        transfer_s=rng.uniform(0.05, 0.10), toe_rad=rng.normal(0.0, 0.0003),
    )  # fmt: skip


def wheels_another_day(car: Numbers, rng: np.random.Generator) -> Numbers:
    """The same car on another day: radius and pads of single wheels off by `DAY_SHARE` of what wheels differ by."""
    radius, pads = (1.0 + DAY_SHARE * share * rng.standard_normal(4) for share in (RADIUS_SHARE, PADS_SHARE))
    return car._replace(radius_m=car.radius_m * radius, mu=car.mu * pads)

"""The van's logger: rows of 20 ms from a bus whose messages have ages and steps of their own."""

from typing import NamedTuple

import numpy as np

from hil.validation.strangers.brake_by_wire_van.course import LEAD_S
from hil.validation.strangers.brake_by_wire_van.motion import (
    ANGLE,
    AX,
    AY,
    CLAMP,
    FRONT_DEMAND,
    MOTOR,
    MOTOR_DEMAND,
    PITCH,
    ROLL,
    ROW_S,
    STEER,
    YAW,
    G,
)
from hil.validation.strangers.brake_by_wire_van.numbers import RADIUS_M, WHEELS, Numbers
from hil.validation.strangers.car import DAY_SHARE
from hil.validation.strangers.signals import Vector, sampled, slow_noise, steps

LOG_S = 0.02
COUNTED_S = 0.01
"""Wheel speeds are means over it."""
FULL_PEDAL_NM = 9000.0
WHITE = {
    "wheel": 0.015, "ax": 0.05, "ay": 0.05, "yaw": 0.002, "pressure": 1.5e4, "motor": 0.8, "steer": 0.001,
    "pressure_demand": 0.0, "motor_demand": 0.0, "pedal": 0.0, "throttle": 0.0,
}  # fmt: skip
SLOW = {"wheel": (0.015, 0.2), "ax": (0.015, 5.0), "ay": (0.015, 5.0), "yaw": (0.0006, 8.0), "motor": (2.0, 3.0)}
STEP = {
    "wheel": 0.0625 / 3.6 / RADIUS_M, "ax": 0.01 * G, "ay": 0.01 * G, "yaw": 0.00175, "pressure": 5e4, "motor": 1.0,
    "steer": 0.00175, "pressure_demand": 5e4, "motor_demand": 1.0, "pedal": 0.004, "throttle": 0.004,
}  # fmt: skip
WHEEL_AGE_S, IMU_AGE_S, MOTOR_AGE_S = (0.010, 0.015), (0.004, 0.006), (0.018, 0.022)
PRESSURE_AGE_S, STEER_AGE_S = (0.008, 0.014), (0.008, 0.012)
"""Ages of frames, least and most: each start draws them anew."""
ZERO_MPS2, AX_GAIN, YAW_ZERO_RAD_S, STEER_ZERO_RAD = 0.02, 0.003, 8e-4, 6e-3
PRESSURE_ZERO_PA, PRESSURE_GAIN = 5e3, 0.004
"""By how much sensors differ, one standard deviation."""


class Logger(NamedTuple):
    """Sensors and the ages of their messages, s; wheels in the order of `WHEELS`. Demands are exact."""

    wheel_age_s: float
    imu_age_s: float
    motor_age_s: float
    pressure_age_s: float
    steer_age_s: float
    ax_zero_mps2: float
    ax_gain: float
    ay_zero_mps2: float
    yaw_zero_rad_s: float
    steer_zero_rad: float
    pressure_zero_pa: Vector
    pressure_gain: Vector


def true_logger(rng: np.random.Generator) -> Logger:
    """The logger of one seed."""
    return Logger(
        wheel_age_s=rng.uniform(*WHEEL_AGE_S), imu_age_s=rng.uniform(*IMU_AGE_S),
        motor_age_s=rng.uniform(*MOTOR_AGE_S), pressure_age_s=rng.uniform(*PRESSURE_AGE_S),
        steer_age_s=rng.uniform(*STEER_AGE_S), ax_zero_mps2=float(rng.normal(0.0, ZERO_MPS2)),
        ax_gain=1.0 + float(rng.normal(0.0, AX_GAIN)), ay_zero_mps2=float(rng.normal(0.0, ZERO_MPS2)),
        yaw_zero_rad_s=float(rng.normal(0.0, YAW_ZERO_RAD_S)), steer_zero_rad=float(rng.normal(0.0, STEER_ZERO_RAD)),
        pressure_zero_pa=rng.normal(0.0, PRESSURE_ZERO_PA, 4), pressure_gain=1.0 + rng.normal(0.0, PRESSURE_GAIN, 4),
    )  # fmt: skip


def sensors_another_day(logger: Logger, rng: np.random.Generator) -> Logger:
    """The same logger on another day: ages of its frames, and zeros and scales off by `DAY_SHARE` of what they are."""

    def off(deviation: float) -> float:
        return DAY_SHARE * deviation * float(rng.standard_normal())

    return logger._replace(
        wheel_age_s=rng.uniform(*WHEEL_AGE_S), imu_age_s=rng.uniform(*IMU_AGE_S),
        motor_age_s=rng.uniform(*MOTOR_AGE_S), pressure_age_s=rng.uniform(*PRESSURE_AGE_S),
        steer_age_s=rng.uniform(*STEER_AGE_S),
        ax_zero_mps2=logger.ax_zero_mps2 + off(ZERO_MPS2), ax_gain=logger.ax_gain + off(AX_GAIN),
        ay_zero_mps2=logger.ay_zero_mps2 + off(ZERO_MPS2), yaw_zero_rad_s=logger.yaw_zero_rad_s + off(YAW_ZERO_RAD_S),
        steer_zero_rad=logger.steer_zero_rad + off(STEER_ZERO_RAD),
        pressure_zero_pa=logger.pressure_zero_pa + DAY_SHARE * PRESSURE_ZERO_PA * rng.standard_normal(4),
        pressure_gain=logger.pressure_gain + DAY_SHARE * PRESSURE_GAIN * rng.standard_normal(4),
    )  # fmt: skip


def logged(
    rows: Vector, asked_nm: Vector, car: Numbers, logger: Logger, rng: np.random.Generator | None
) -> dict[str, Vector]:
    """Columns of docs/explain-inputs.md from the true motion (`hil.validation.strangers.brake_by_wire_van.motion.run`).

    Parameters
    ----------
    asked_nm : (n,) torque asked by the pedals.  rng : of the noise of the sensors; None leaves out noise and steps.
    """
    t: Vector = np.arange(len(rows), dtype=np.float64) * ROW_S
    at = np.arange(LEAD_S, t[-1], LOG_S)
    found = {"t_s": at - LEAD_S}

    def tell(name: str, kind: str, values: Vector, moving: Vector | float = 1.0) -> None:
        if rng is not None:
            noise = rng.normal(0.0, WHITE[kind], len(values))
            if kind in SLOW:
                noise += slow_noise(rng, len(values), LOG_S, *SLOW[kind])
            values = steps(values + moving * noise, STEP[kind])
        found[name] = values

    for i, wheel in enumerate(WHEELS):
        old = at - logger.wheel_age_s
        turns = rows[:, ANGLE + i]
        # told at the end of the count, which has begun within what the age says
        speed = (sampled(t, turns, old + COUNTED_S / 2.0) - sampled(t, turns, old - COUNTED_S / 2.0)) / COUNTED_S
        tell(f"wheel_speed_{wheel}_rad_s", "wheel", speed, np.clip(np.abs(speed) / 5.0, 0.0, 1.0))
    old = at - logger.imu_age_s
    ax = rows[:, AX] + G * car.dive_rad_s2_m * rows[:, PITCH]
    ay = rows[:, AY] + G * car.roll_rad_s2_m * rows[:, ROLL]
    tell("ax_mps2", "ax", logger.ax_gain * sampled(t, ax, old) + logger.ax_zero_mps2)
    tell("ay_mps2", "ay", sampled(t, ay, old) + logger.ay_zero_mps2)
    tell("yaw_rate_rad_s", "yaw", sampled(t, rows[:, YAW], old) + logger.yaw_zero_rad_s)
    for i, wheel in enumerate(WHEELS):
        clamp = sampled(t, rows[:, CLAMP + i], at - logger.pressure_age_s)
        tell(f"pressure_{wheel}_pa", "pressure", logger.pressure_gain[i] * clamp + logger.pressure_zero_pa[i])
        tell(f"pressure_demand_{wheel}_pa", "pressure_demand", sampled(t, rows[:, FRONT_DEMAND + i // 2], at))
    torque, demand = (
        0.5 * sampled(t, rows[:, MOTOR], at - logger.motor_age_s),
        0.5 * sampled(t, rows[:, MOTOR_DEMAND], at),
    )
    tell("motor_torque_rl_nm", "motor", torque)
    tell("motor_torque_demand_rl_nm", "motor_demand", demand)
    for kind in ("motor_torque", "motor_torque_demand"):
        found[f"{kind}_rr_nm"] = found[f"{kind}_rl_nm"].copy()
    tell("steer_rad", "steer", sampled(t, rows[:, STEER], at - logger.steer_age_s) + logger.steer_zero_rad)
    asked = sampled(t, asked_nm[: len(t)], at) / FULL_PEDAL_NM
    tell("pedal", "pedal", np.clip(-asked, 0.0, 1.0))
    tell("throttle", "throttle", np.clip(asked, 0.0, 1.0))
    return found

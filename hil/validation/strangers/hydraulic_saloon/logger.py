"""The saloon's logger: rows of 10 ms, each signal with its own age."""

from typing import NamedTuple

import numpy as np

from hil.validation.strangers.car import DAY_SHARE
from hil.validation.strangers.hydraulic_saloon.course import LEAD_S
from hil.validation.strangers.hydraulic_saloon.motion import (
    ANGLE,
    AX,
    AY,
    MASTER,
    PRESSURE,
    STEER,
    STEP_S,
    TRANSFER,
    VX,
    YAW,
    G,
)
from hil.validation.strangers.hydraulic_saloon.numbers import WHEELS, Numbers
from hil.validation.strangers.signals import Vector, low_pass, sampled, slow_noise, steps, tooth_speeds

ROW_S = 0.01
TEETH = 44
FINE_TEETH = 44 * 50
"""Where noise and steps are left out."""
WHITE = {"wheel": 0.006, "ax": 0.03, "ay": 0.03, "yaw": 0.0012, "pressure": 6e3, "steer": 0.0015, "speed": 0.025}
SLOW = {"wheel": (0.006, 0.15), "ax": (0.008, 6.0), "ay": (0.008, 6.0), "yaw": (0.0006, 8.0), "speed": (0.03, 1.5)}
STEP = {"ax": 0.01, "ay": 0.01, "yaw": 0.0005, "pressure": 1e4, "steer": 0.00175, "speed": 0.01}
IMU_AGE_S, PRESSURE_AGE_S = (0.006, 0.014), (0.001, 0.006)
"""Ages of frames, least and most: each start draws them anew."""
ZERO_MPS2, AX_GAIN, YAW_ZERO_RAD_S, STEER_ZERO_RAD = 0.02, 0.003, 8e-4, 6e-3
PRESSURE_ZERO_PA, PRESSURE_GAIN = 5e3, 0.004
"""By how much sensors differ, one standard deviation."""


class Logger(NamedTuple):
    """Sensors and their ages, s; wheels in the order of `WHEELS`.

    Attributes
    ----------
    imu_cutoff_hz, imu_age_s : of the filter in the sensor, and of its messages.  wheel_age_s : beside the counting.
    runout : share of a wheel's speed at the first order.
    master : whether the front pressure is that of the master cylinder; else all four are at the wheel cylinders.
    """

    imu_cutoff_hz: float
    imu_age_s: float
    wheel_age_s: float
    pressure_age_s: float
    speed_age_s: float
    ax_zero_mps2: float
    ax_gain: float
    ay_zero_mps2: float
    yaw_zero_rad_s: float
    steer_zero_rad: float
    pressure_zero_pa: Vector
    pressure_gain: Vector
    speed_gain: float
    runout: Vector
    master: bool


def true_logger(rng: np.random.Generator, master: bool) -> Logger:
    """The logger of one seed."""
    return Logger(
        imu_cutoff_hz=rng.uniform(12.0, 20.0), imu_age_s=rng.uniform(*IMU_AGE_S), wheel_age_s=0.0,
        pressure_age_s=rng.uniform(*PRESSURE_AGE_S), speed_age_s=rng.uniform(0.10, 0.20),
        ax_zero_mps2=float(rng.normal(0.0, ZERO_MPS2)), ax_gain=1.0 + float(rng.normal(0.0, AX_GAIN)),
        ay_zero_mps2=float(rng.normal(0.0, ZERO_MPS2)), yaw_zero_rad_s=float(rng.normal(0.0, YAW_ZERO_RAD_S)),
        steer_zero_rad=float(rng.normal(0.0, STEER_ZERO_RAD)), pressure_zero_pa=rng.normal(0.0, PRESSURE_ZERO_PA, 4),
        pressure_gain=1.0 + rng.normal(0.0, PRESSURE_GAIN, 4), speed_gain=1.0, runout=np.zeros(4), master=master,
    )  # fmt: skip


def sensors_another_day(logger: Logger, rng: np.random.Generator) -> Logger:
    """The same logger on another day: ages of its frames, and zeros and scales off by `DAY_SHARE` of what they are."""

    def off(deviation: float) -> float:
        return DAY_SHARE * deviation * float(rng.standard_normal())

    return logger._replace(
        imu_age_s=rng.uniform(*IMU_AGE_S), pressure_age_s=rng.uniform(*PRESSURE_AGE_S),
        ax_zero_mps2=logger.ax_zero_mps2 + off(ZERO_MPS2), ax_gain=logger.ax_gain + off(AX_GAIN),
        ay_zero_mps2=logger.ay_zero_mps2 + off(ZERO_MPS2), yaw_zero_rad_s=logger.yaw_zero_rad_s + off(YAW_ZERO_RAD_S),
        steer_zero_rad=logger.steer_zero_rad + off(STEER_ZERO_RAD),
        pressure_zero_pa=logger.pressure_zero_pa + DAY_SHARE * PRESSURE_ZERO_PA * rng.standard_normal(4),
        pressure_gain=logger.pressure_gain + DAY_SHARE * PRESSURE_GAIN * rng.standard_normal(4),
    )  # fmt: skip


def logged(rows: Vector, car: Numbers, logger: Logger, rng: np.random.Generator | None) -> dict[str, Vector]:
    """Columns of docs/explain-inputs.md from the true motion (`hil.validation.strangers.hydraulic_saloon.motion.run`).

    Parameters
    ----------
    rng : of the noise of the sensors; None leaves out noise and steps.
    """
    t: Vector = np.arange(len(rows), dtype=np.float64) * STEP_S
    at = np.arange(LEAD_S, t[-1], ROW_S)
    found = {"t_s": at - LEAD_S}

    def tell(name: str, kind: str, values: Vector) -> None:
        if rng is not None:
            values = values + rng.normal(0.0, WHITE[kind], len(values))
            if kind in SLOW:
                deviation, time_s = SLOW[kind]
                values = values + slow_noise(rng, len(values), ROW_S, deviation, time_s)
            values = steps(values, STEP[kind])
        found[name] = values

    messages = np.arange(0.02, t[-1] + 0.019, 0.02)
    for i, wheel in enumerate(WHEELS):
        turns = rows[:, ANGLE + i]
        seen = turns - logger.runout[i] * (np.cos(turns) - 1.0)
        shift = 0.0 if rng is None else rng.random()
        stamps, speeds = tooth_speeds(t, seen, messages, FINE_TEETH if rng is None else TEETH, shift)
        values = sampled(stamps + logger.wheel_age_s, speeds, at)
        if rng is not None:
            moving = np.minimum(values / 5.0, 1.0)
            deviation, time_s = SLOW["wheel"]
            values = values + moving * (
                rng.normal(0.0, WHITE["wheel"], len(at)) + slow_noise(rng, len(at), ROW_S, deviation, time_s)
            )
        found[f"wheel_speed_{wheel}_rad_s"] = values
    old = at - logger.imu_age_s
    ax = low_pass(rows[:, AX] + G * car.dive_rad_s2_m * rows[:, TRANSFER], STEP_S, logger.imu_cutoff_hz)
    ay = low_pass(rows[:, AY] + G * car.roll_rad_s2_m * rows[:, TRANSFER + 1], STEP_S, logger.imu_cutoff_hz)
    tell("ax_mps2", "ax", logger.ax_gain * sampled(t, ax, old) + logger.ax_zero_mps2)
    tell("ay_mps2", "ay", sampled(t, ay, old) + logger.ay_zero_mps2)
    yaw = low_pass(rows[:, YAW], STEP_S, logger.imu_cutoff_hz)
    tell("yaw_rate_rad_s", "yaw", sampled(t, yaw, old) + logger.yaw_zero_rad_s)
    for i, wheel in enumerate(WHEELS):
        where = MASTER if logger.master and i < 2 else PRESSURE + i
        pressure = sampled(t, rows[:, where], at - logger.pressure_age_s)
        tell(f"pressure_{wheel}_pa", "pressure", logger.pressure_gain[i] * pressure + logger.pressure_zero_pa[i])
    tell("steer_rad", "steer", sampled(t, rows[:, STEER], at - 0.006) + logger.steer_zero_rad)
    fixes = np.arange(0.0, t[-1] + 0.1, 0.1)
    speed = logger.speed_gain * sampled(t, rows[:, VX], fixes)
    if rng is not None:
        speed = speed + rng.normal(0.0, WHITE["speed"], len(fixes))
        speed = steps(np.maximum(speed + slow_noise(rng, len(fixes), 0.1, *SLOW["speed"]), 0.0), STEP["speed"])
    found["speed_mps"] = sampled(fixes, speed, at - logger.speed_age_s)
    return found

"""Sensors and logger of the car `dead_time`: what a seed draws, and a log from a script."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.validation.strangers.car import DAY_SHARE, Noise, Vector
from hil.validation.strangers.dead_time.motion import STEP_S, Corners, Motion, Numbers, move
from hil.validation.strangers.dead_time.script import CYCLE_S, Script

WHEELS = ("fl", "fr", "rl", "rr")
RADIUS_M, GAIN_FRONT, GAIN_REAR = 0.335, 3.3e-4, 1.65e-4
LEAD_S, STANDS_S, ROW_S = 0.2, 1.2, 0.01
DISC_K = 350.0
OLD_S = (0.008, 0.013)
NODES = ("wheel", "imu", "pressure", "motor", "ground")
WHEEL_PADS, WHEEL_RADIUS, WHEEL_MOTOR, WHEEL_GAIN, WHEEL_ZERO_PA = 0.01, 0.0012, 0.005, 0.005, 7e3
"""By how much wheels differ (one standard deviation, docs/vehicle-set.md); those of this car by `ALIKE` of it."""
ALIKE = 0.4
AX_ZERO_MPS2, YAW_ZERO_RAD_S, AX_SCALE, GROUND_SCALE = 0.025, 0.001, 0.01, 0.005
"""What sensors as bought err by (one standard deviation); these by `ALIKE` of it."""
SENSORS = (
    (tuple(f"wheel_speed_{w}_rad_s" for w in WHEELS), 0.025, 0.0, 0.02),
    (("ax_mps2",), 0.04, 0.01, 0.01),
    (("ay_mps2",), 0.04, 0.012, 0.01),
    (("yaw_rate_rad_s",), 0.0025, 0.0005, 0.0005),
    (tuple(f"pressure_{w}_pa" for w in WHEELS), 9e3, 2.5e3, 5e3),
    (tuple(f"motor_torque_{w}_nm" for w in WHEELS), 2.0, 0.7, 0.5),
    (("speed_mps",), 0.03, 0.0, 0.01),
)
"""Columns; usual white and coloured noise (standard deviations), of which a drive has 0.7 to 1.35; step."""


@dataclass(frozen=True)
class Drawn:
    """What a seed draws: ages of the nodes and phase of the controller (s), noise, corners, zeros and scales."""

    ages_s: dict[str, float]
    phase_s: float
    noise: Noise
    corners: Corners
    pressure_zero_pa: Vector
    pressure_scale: Vector
    ax_zero_mps2: float
    yaw_zero_rad_s: float
    ax_scale: float
    ground_scale: float


def _noise(rng: np.random.Generator) -> Noise:
    white, coloured = {}, {}
    for columns, usual, drift, step in SENSORS:
        size, slow = rng.uniform(0.7, 1.35, 2)
        tau_s = float(rng.uniform(6.0, 14.0))
        for column in columns:
            white[column] = float(np.hypot(size * usual, step / 12**0.5))
            coloured[column] = (float(slow * drift), tau_s)
    gust = (float(rng.uniform(0.008, 0.025)), float(rng.uniform(2.0, 6.0)))
    slope = (float(rng.uniform(0.006, 0.02)), float(rng.uniform(3.0, 9.0)))
    return Noise(white, coloured, gust, slope)


def draw(seed: int) -> Drawn:
    """All that a drive has of its own but its script, gusts and road."""
    rng = np.random.default_rng([seed, 1])
    ages = {node: float(rng.uniform(*OLD_S)) for node in NODES}
    gains = np.repeat([GAIN_FRONT, GAIN_REAR], 2)
    spread = [1.0 + ALIKE * size * rng.standard_normal(4) for size in (WHEEL_RADIUS, WHEEL_PADS, WHEEL_MOTOR)]
    return Drawn(
        ages, float(rng.uniform(0.0, CYCLE_S)), _noise(rng),
        Corners(RADIUS_M * spread[0], gains * spread[1], np.zeros(4), spread[2]),
        ALIKE * WHEEL_ZERO_PA * rng.standard_normal(4), 1.0 + ALIKE * WHEEL_GAIN * rng.standard_normal(4),
        *(ALIKE * size * float(rng.standard_normal()) for size in (AX_ZERO_MPS2, YAW_ZERO_RAD_S)),
        *(1.0 + ALIKE * size * float(rng.standard_normal()) for size in (AX_SCALE, GROUND_SCALE)),
    )  # fmt: skip


def another_day(seed: int, day: int) -> Drawn:
    """The drive of ``day`` in the car of ``seed``: its wheels and sensors, off by half of what ``day`` draws for them.

    Ages of the nodes, phase of the controller and noise are those of the day.
    """
    own, drawn = draw(seed), draw(day)
    wheels, others = own.corners, drawn.corners
    gains = np.repeat([GAIN_FRONT, GAIN_REAR], 2)
    return replace(
        drawn,
        corners=Corners(
            wheels.radius_m + DAY_SHARE * (others.radius_m - RADIUS_M),
            wheels.brake_gain_nm_pa + DAY_SHARE * (others.brake_gain_nm_pa - gains),
            wheels.drag_nm, wheels.motor_gain + DAY_SHARE * (others.motor_gain - 1.0),
        ),
        pressure_zero_pa=own.pressure_zero_pa + DAY_SHARE * drawn.pressure_zero_pa,
        pressure_scale=own.pressure_scale + DAY_SHARE * (drawn.pressure_scale - 1.0),
        ax_zero_mps2=own.ax_zero_mps2 + DAY_SHARE * drawn.ax_zero_mps2,
        yaw_zero_rad_s=own.yaw_zero_rad_s + DAY_SHARE * drawn.yaw_zero_rad_s,
        ax_scale=own.ax_scale + DAY_SHARE * (drawn.ax_scale - 1.0),
        ground_scale=own.ground_scale + DAY_SHARE * (drawn.ground_scale - 1.0),
    )  # fmt: skip


def _ar1(size: tuple[float, float], n: int, step_s: float, rng: np.random.Generator) -> Vector:
    """First-order noise of a standard deviation and a time constant (s), (n,)."""
    keep = float(np.exp(-step_s / size[1]))
    driven = rng.standard_normal(n) * size[0] * (1.0 - keep * keep) ** 0.5
    driven[0] = size[0] * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], driven))


def log(script: Script, numbers: Numbers, drawn: Drawn, seed: Sequence[int], noisy: bool) -> dict[str, Vector]:
    """One log; it ends `STANDS_S` after the car stands. Sensors at a row are those of their age before it."""
    rng = np.random.default_rng(seed)
    n = round((LEAD_S + script.lasts_s) / STEP_S)
    t_s = np.arange(n) * STEP_S - LEAD_S
    slope, gust = (_ar1(size, n, STEP_S, rng) for size in (drawn.noise.slope_mps2, drawn.noise.gust_mps2))
    held_s = np.floor((t_s - drawn.phase_s) / CYCLE_S) * CYCLE_S + drawn.phase_s  # the controller's last cycle
    pressure, torque, steer = script.pressure_demand(held_s), script.torque_demand(held_s), script.steer(held_s)
    motion = Motion(*move(numbers, drawn.corners, pressure, torque, steer, gust, slope, script.speed_mps, DISC_K))
    rows = round(min(script.lasts_s, _standing_s(motion) + STANDS_S) / ROW_S)
    row_s = np.arange(rows) * ROW_S

    def at(node: str) -> NDArray[np.int64]:
        return np.asarray(np.round((row_s + LEAD_S - drawn.ages_s[node]) / STEP_S), np.int64)

    now = np.asarray(np.round((row_s + LEAD_S) / STEP_S), np.int64)
    table: dict[str, Vector] = {"t_s": np.asarray(row_s)}
    scale = drawn.pressure_scale
    for i, w in enumerate(WHEELS):
        table[f"wheel_speed_{w}_rad_s"] = motion.omega_rad_s[at("wheel"), i]
        table[f"pressure_{w}_pa"] = scale[i] * motion.pressure_pa[at("pressure"), i] + drawn.pressure_zero_pa[i]
        table[f"motor_torque_{w}_nm"] = motion.torque_nm[at("motor"), i]
        table[f"pressure_demand_{w}_pa"] = pressure[now, i]
        table[f"motor_torque_demand_{w}_nm"] = torque[now, i]
    table["ax_mps2"] = drawn.ax_scale * motion.force_mps2[at("imu")] + drawn.ax_zero_mps2
    table["ay_mps2"] = motion.side_mps2[at("imu")]
    table["yaw_rate_rad_s"] = motion.yaw_rate_rad_s[at("imu")] + drawn.yaw_zero_rad_s
    table["speed_mps"] = drawn.ground_scale * motion.speed_mps[at("ground")]
    table["steer_rad"] = steer[now]
    return _measured(table, drawn.noise, rng) if noisy else table


def _standing_s(motion: Motion) -> float:
    stands = motion.speed_mps == 0.0
    return float(np.argmax(stands)) * STEP_S - LEAD_S if stands.any() else float("inf")


def _measured(table: dict[str, Vector], noise: Noise, rng: np.random.Generator) -> dict[str, Vector]:
    """The table with noise, then in steps; a wheel that stands has no noise."""
    found = dict(table)
    for columns, _, _, step in SENSORS:
        for column in columns:
            true, n = table[column], table[column].size
            white = (noise.white[column] ** 2 - step**2 / 12.0) ** 0.5
            told = true + white * rng.standard_normal(n) + _ar1(noise.coloured[column], n, ROW_S, rng)
            if column.startswith("wheel_speed"):
                told[true == 0.0] = 0.0
            found[column] = np.asarray(step * np.round(told / step))
    return found

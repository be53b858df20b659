"""Logs as a stranger writes them: a car of one page that brakes, pulls and turns, in anybody's names and units."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

RADIUS_M, TRACK_M, WHEELBASE_M, RATIO, MASS_KG = 0.318, 1.55, 2.72, 15.0, 1650.0
GAIN_NM_PA = {"f": 2.9e-4, "r": 1.7e-4}
PER_PA = 2.0 * sum(GAIN_NM_PA.values()) / (MASS_KG * RADIUS_M)
"""Deceleration per pressure, m/s2 per Pa."""
WHEELS = ("fl", "fr", "rl", "rr")
STEP_S = 0.01
SET = {
    "mass_kg": MASS_KG, "wheelbase_m": WHEELBASE_M, "cog_to_front_axle_m": 1.3, "rolling_radius_m": RADIUS_M,
    "brake_gain_front_nm_pa": GAIN_NM_PA["f"], "brake_gain_rear_nm_pa": GAIN_NM_PA["r"],
}  # fmt: skip


def drive(seed: int = 3, seconds: float = 45.0) -> dict[str, np.ndarray]:
    """Canonical channels, SI: three stops to standstill with a pull before each, bends throughout, a slope."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP_S)
    t = np.arange(n) * STEP_S
    phase = t % 15.0
    asked = np.where((phase > 8.0) & (phase < 13.5), 2.5e6 + 8e5 * (t // 15.0), 0.0)
    pull, pressure, v, a = np.where((phase > 0.8) & (phase < 6.0), 2.6, 0.0), np.zeros(n), np.zeros(n), np.zeros(n)
    p, now = 0.0, 0.0
    for k in range(n):
        p += STEP_S / 0.06 * (asked[k] - p)
        force = pull[k] - PER_PA * p - 0.12
        a[k] = force if now > 0.05 or force > 0.0 else 0.0
        now = max(now + a[k] * STEP_S, 0.0) if a[k] else 0.0
        pressure[k], v[k] = p, now
    steer = 0.9 * np.sin(0.7 * t) * np.exp(-((phase - 7.0) ** 2) / 8.0)
    yaw = v * steer / (RATIO * WHEELBASE_M)
    slope = 9.81 * 0.02 * np.sin(t / 9.0)
    out = {
        "t_s": t, "speed_mps": v, "ax_mps2": a + slope, "ay_mps2": v * yaw, "yaw_rate_rad_s": yaw, "steer_rad": steer,
        "pedal": asked / 8e6,
    }  # fmt: skip
    for wheel, side in zip(WHEELS, (-1.0, 1.0, -1.0, 1.0), strict=True):
        out[f"wheel_speed_{wheel}_rad_s"] = (v + 0.5 * side * TRACK_M * yaw) / RADIUS_M
        out[f"pressure_{wheel}_pa"] = pressure
    size = {
        "speed": 0.02,
        "ax": 0.05,
        "ay": 0.05,
        "yaw": 0.002,
        "steer": 0.002,
        "wheel": 0.03,
        "press": 1e4,
        "pedal": 1e-3,
    }
    for name in out:
        sd = next((value for stem, value in size.items() if name.startswith(stem)), 0.0)
        out[name] = out[name] + sd * rng.standard_normal(n) * ((out[name] != 0.0) if name.startswith("wheel") else 1.0)
    return out


HEADS: Mapping[str, tuple[str, float]] = {
    "t_s": ("Time [s]", 1.0),
    **{f"wheel_speed_{w}_rad_s": (f"WhlSpd_{w.upper()} [km/h]", 3.6 * RADIUS_M) for w in WHEELS},
    "speed_mps": ("GPS_Speed [mph]", 1.0 / 0.44704),
    "ax_mps2": ("Acc_X [g]", -1.0 / 9.80665),
    "ay_mps2": ("LateralAcc [m/s^2]", 1.0),
    "yaw_rate_rad_s": ("GyroYaw [deg/s]", -180.0 / np.pi),
    "steer_rad": ("SteeringWheelAngle [deg]", 180.0 / np.pi),
    **{f"pressure_{w}_pa": (f"pBrake{w.upper()} [bar]", 1e-5) for w in WHEELS},
    "pedal": ("BrakePedal [%]", 100.0),
}
"""Channel -> head in a stranger's table, and his number for one of ours."""


def write(path: Path, channels: Mapping[str, np.ndarray], heads: Mapping[str, tuple[str, float]] = HEADS) -> Path:
    """A table of those channels that have a head."""
    columns = {head: factor * channels[name] for name, (head, factor) in heads.items() if name in channels}
    np.savetxt(path, np.column_stack(list(columns.values())), "%.6g", ",", header=",".join(columns), comments="")
    return path


def late(channels: Mapping[str, np.ndarray], name: str, rows: int) -> dict[str, np.ndarray]:
    """The same with one channel ``rows`` rows later."""
    values = channels[name]
    return {**channels, name: np.concatenate((values[:1].repeat(rows), values[:-rows]))}


def fill_in(path: Path, numbers: Mapping[str, float]) -> Path:
    """What a user does with a drafted set: the question marks become numbers."""
    text = path.read_text("utf-8")
    for key, value in numbers.items():
        text = text.replace(f"# {key} = ?", f"{key} = {value!r}")
    path.write_text(text, "utf-8")
    return path

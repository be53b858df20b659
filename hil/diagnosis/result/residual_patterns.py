"""What the simulation misses, by channel: size against the noise, and what it goes with. Names no cause."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.noise.model import Noise, SampleMasks
from plant.vectors import INPUT

WORDS = {
    "wheel.mean": "wheel_speed", "wheel.front-rear": "wheel_speed_front_minus_rear",
    "wheel.left-right front": "wheel_speed_left_minus_right_front",
    "wheel.left-right rear": "wheel_speed_left_minus_right_rear", "ax": "ax_mps2", "ay": "ay_mps2",
    "yaw": "yaw_rate_rad_s", "gps": "speed_mps", "pressure.mean": "pressure",
    "pressure.front-rear": "pressure_front_minus_rear", "pressure.left-right front": "pressure_left_minus_right_front",
    "pressure.left-right rear": "pressure_left_minus_right_rear", "motor.mean": "motor_torque",
    "motor.front-rear": "motor_torque_front_minus_rear",
    "motor.left-right front": "motor_torque_left_minus_right_front",
    "motor.left-right rear": "motor_torque_left_minus_right_rear",
}  # fmt: skip
UNITS = {"wheel": "m/s", "ax": "m/s2", "ay": "m/s2", "yaw": "rad/s", "gps": "m/s", "pressure": "Pa", "motor": "N m"}
"""Units of the tracks, by group; wheel speeds are compared as speeds at the rolling radius."""
_SEEN = 1.15
_STRONG = 0.25


@dataclass(frozen=True)
class ResidualPattern:
    """One channel: root mean square of the residual, what noise alone would leave, and what the rest goes with."""

    track: str
    channel: str
    unit: str
    rms: float
    noise: float
    pattern: str


def residual_patterns(found: Diagnosis) -> list[ResidualPattern]:
    """Of every track, of the simulation as handed in."""
    frame = found.fitter.masks
    with_what = _variables(found.dataset)
    quiet = _expected(found, frame, found.noise)
    listed = []
    for name in frame.names:
        values = found.nominal.residual[name][:, 0]
        known = frame.present[name] > 0.5
        rms, noise = float(np.sqrt(np.mean(values[known] ** 2))), quiet[name]
        pattern = "noise" if rms < _SEEN * noise else _pattern(name, values, known, with_what, frame)
        listed.append(ResidualPattern(name, WORDS[name], UNITS[name.split(".")[0]], rms, noise, pattern))
    return listed


def _expected(found: Diagnosis, frame: SampleMasks, noise: Noise) -> dict[str, float]:
    """What noise and disturbance leave: of the final model where it is white, never above the residual's own."""
    final = found.final.residual
    return {name: float(np.sqrt(np.mean(final[name][frame.present[name] > 0.5, 0] ** 2))) for name in frame.names}


def _variables(case: Dataset) -> dict[str, Floats]:
    parts: dict[str, list[Floats]] = {}
    for drive in case.recordings:
        at = np.arange(drive.samples) * drive.stride

        def mean(name: str, at: Floats = at, inputs: Floats = drive.inputs) -> Floats:
            return np.asarray(inputs[np.asarray(at, np.int64)][:, INPUT.slice(name)].mean(axis=1))

        pressure = np.maximum(mean("pressure_pa"), mean("pressure_demand_pa"))
        applied = pressure > 2e5
        parts.setdefault("pressure", []).append(pressure)
        parts.setdefault("motor torque", []).append(mean("motor_torque_nm"))
        parts.setdefault("speed", []).append(drive.speed_mps)
        parts.setdefault("steering", []).append(mean("steering_wheel_rad"))
        parts.setdefault("time in the log", []).append(at * 0.01)
        heat = np.cumsum(pressure * drive.speed_mps)
        parts.setdefault("brake work so far", []).append(heat)
        parts.setdefault("rate of pressure", []).append(np.gradient(pressure))
        parts.setdefault("speed while braking", []).append(np.where(applied, drive.speed_mps, np.nan))
    return {name: np.concatenate(p) for name, p in parts.items()}


def _pattern(name: str, values: Floats, known: Floats, variables: dict[str, Floats], frame: SampleMasks) -> str:
    shown = values.copy()
    if name in ("wheel.mean", "gps"):  # the speed's error grows: its slope is what goes with things
        n = 25
        slope = np.convolve(values, np.concatenate((np.ones(n), -np.ones(n))) / (n * n * frame.sample_s), mode="same")
        restarts = np.convolve((frame.segment_start + frame.log_start) > 0.5, np.ones(2 * n + 1), mode="same") > 0.5
        shown = np.where(restarts, np.nan, slope)
    step = max(int(0.1 / frame.sample_s), 1)
    found = []
    for what, variable in variables.items():
        good = (known > 0.5) & np.isfinite(shown) & np.isfinite(variable)
        x, y = variable[good][::step], shown[good][::step]
        if len(x) > 40 and np.ptp(x) > 0.0 and np.ptp(y) > 0.0:
            found.append((float(spearmanr(x, y)[0]), what))
    found.sort(key=lambda item: -abs(item[0]))
    offset = float(np.nanmean(shown[known > 0.5])) / max(float(np.nanstd(shown[known > 0.5])), 1e-12)
    if found and abs(found[0][0]) > _STRONG:
        words = [f"{'grows' if r > 0 else 'falls'} with {what} ({r:+.2f})" for r, what in found[:2] if abs(r) > _STRONG]
        return "; ".join(words)
    return "constant offset" if abs(offset) > 0.7 else "no simple pattern"

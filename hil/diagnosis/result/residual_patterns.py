"""Residual patterns: what the nominal simulation misses, by channel, and what it correlates with. Names no cause."""

from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.result.statistics import pattern
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
"""Units by group of channels; wheel speeds are compared as speeds at the rolling radius."""
_NOISE_RATIO = 1.15
"""Root mean square over that of noise, below which a residual counts as noise."""


@dataclass(frozen=True)
class ResidualPattern:
    """One channel: root mean squares of the residual and of noise alone, in its unit, and the correlated variables."""

    track: str
    channel: str
    unit: str
    rms: float
    noise: float
    pattern: str


def residual_patterns(diagnosis: Diagnosis) -> list[ResidualPattern]:
    """The pattern of every channel in the simulation of the nominal vehicle."""
    masks = diagnosis.fitter.masks
    variables = variables_of(diagnosis.dataset)
    expected = _expected(diagnosis, masks)
    patterns = []
    for name in masks.names:
        values = diagnosis.nominal.residual[name][:, 0]
        known = (masks.present[name] > 0.5) & diagnosis.compared_samples
        rms, noise = float(np.sqrt(np.mean(values[known] ** 2))), expected[name]
        text = "noise" if rms < _NOISE_RATIO * noise else _pattern(name, values, known, variables, masks)
        patterns.append(ResidualPattern(name, WORDS[name], UNITS[name.split(".")[0]], rms, noise, text))
    return patterns


def _expected(diagnosis: Diagnosis, masks: SampleMasks) -> dict[str, float]:
    """Root mean square that noise and disturbances leave: that of the final model's residual."""
    final, compared = diagnosis.final.residual, diagnosis.compared_samples
    known = {name: (masks.present[name] > 0.5) & compared for name in masks.names}
    return {name: float(np.sqrt(np.mean(final[name][known[name], 0] ** 2))) for name in masks.names}


def variables_of(dataset: Dataset) -> dict[str, Floats]:
    """What a residual may go with, (samples,) over all recordings by name."""
    parts: dict[str, list[Floats]] = {}
    for recording in dataset.recordings:
        at = np.arange(recording.samples) * recording.stride

        def mean(name: str, at: Floats = at, inputs: Floats = recording.inputs) -> Floats:
            return np.asarray(inputs[np.asarray(at, np.int64)][:, INPUT.slice(name)].mean(axis=1))

        pressure = np.maximum(mean("pressure_pa"), mean("pressure_demand_pa"))
        applied = pressure > 2e5
        parts.setdefault("pressure", []).append(pressure)
        parts.setdefault("motor torque", []).append(mean("motor_torque_nm"))
        parts.setdefault("speed", []).append(recording.speed_mps)
        parts.setdefault("steering", []).append(mean("steering_wheel_rad"))
        parts.setdefault("time in the log", []).append(at * 0.01)
        heat = np.cumsum(pressure * recording.speed_mps)
        parts.setdefault("brake work so far", []).append(heat)
        parts.setdefault("rate of pressure", []).append(np.gradient(pressure))
        parts.setdefault("speed while braking", []).append(np.where(applied, recording.speed_mps, np.nan))
    return {name: np.concatenate(p) for name, p in parts.items()}


def _pattern(name: str, values: Floats, known: Floats, variables: dict[str, Floats], masks: SampleMasks) -> str:
    shown = values.copy()
    if name in ("wheel.mean", "gps"):  # the error of the speed accumulates: its slope correlates
        n, count = max(round(0.5 / masks.sample_s), 1), len(values)
        weights = np.concatenate((np.ones(n), -np.ones(n))) / (n * n * masks.sample_s)
        near = np.convolve((masks.segment_start + masks.log_start) > 0.5, np.ones(2 * n + 1))[n : n + count]
        shown = np.where(near > 0.5, np.nan, np.convolve(values, weights)[n - 1 : n - 1 + count])
    step = max(int(0.1 / masks.sample_s), 1)
    return pattern(shown, known, variables, step)

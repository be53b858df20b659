"""Across the car: yaw rate and lateral acceleration against what the wheels of one axle say of the turn."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import Linear, innovations
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.wheel_radius import SPREAD

_NOISE: Final[Mapping[str, Parameter]] = {
    "turn_rad_s": Parameter(0.05, 1e-3, 2.0, 0.3, True, 2.0),
    "turn_s": Parameter(3.0, 0.1, 100.0, 0.3, True, 1.0),
    "axle_rad_s": Parameter(0.01, 1e-4, 1.0, 0.3, True, 2.0),
    "axle_s": Parameter(0.5, 0.05, 20.0, 0.3, True, 1.0),
    "axle_white_rad_s": Parameter(0.01, 1e-4, 1.0, 0.3, True, 2.0),
    "yaw_rad_s": Parameter(0.003, 1e-5, 1.0, 0.3, True, 2.0),
    "bank_mps2": Parameter(0.2, 1e-3, 5.0, 0.3, True, 1.5),
    "bank_s": Parameter(2.0, 0.1, 60.0, 0.3, True, 1.0),
    "ay_mps2": Parameter(0.05, 1e-3, 5.0, 0.3, True, 2.0),
}
_NUMBERS: Final[Mapping[str, Parameter]] = {
    "yaw_gain": Parameter(0.0, -12.0, 300.0, 0.05),
    "yaw_bias_rad_s": Parameter(0.0, -0.3, 0.3, 2e-3),
    "ay_gain": Parameter(0.0, -12.0, 300.0, 0.05),
    "ay_bias_mps2": Parameter(0.0, -3.0, 3.0, 0.05),
}


class LateralModel(SensorModel):
    """States: yaw rate, error of the axle's difference, bank and sliding (m/s2), unlike radii of the axle's wheels.

    An axle that is locked says nothing of turns, so the one that goes better with the sensors speaks: ``axle``.
    It says (v_right - v_left) / track, the gyro the yaw rate, the accelerometer v times it.
    """

    noise = _NOISE

    def __init__(self, motion: Motion, track_m: Mapping[str, float]) -> None:
        self.motion = motion
        empty = np.full(len(motion.t_s), np.nan)
        yaw, ay = (motion.channels.get(name, empty) for name in ("yaw_rate_rad_s", "ay_mps2"))
        turn = yaw if np.isfinite(yaw).sum() > 50 else ay / np.maximum(motion.speed_mps, 1.0)
        found = {axle: self._difference(motion, axle, track_m) for axle in "fr"}
        self.follows = {axle: _together(values, turn, motion) for axle, values in found.items()}
        self.axle = max("rf", key=lambda axle: abs(self.follows[axle]))
        self._y = np.column_stack([found[self.axle], yaw, ay])
        self._known = np.isfinite(self._y) * motion.moving[:, None]
        there = [name for name in ("yaw", "ay") if self._known[:, 1 if name == "yaw" else 2].sum() > 50]
        self.unknown = ("ay_bias_mps2",) if "ay" in there else ()  # the road's crossfall is in it
        self._pair = 2.0**0.5 * SPREAD / track_m[self.axle]
        self.parameters = {n: v for n, v in _NUMBERS.items() if n.split("_")[0] in there}

    @staticmethod
    def _difference(motion: Motion, axle: str, track_m: Mapping[str, float]) -> Floats:
        return np.asarray(motion.channels[f"wheel_{axle}r"] - motion.channels[f"wheel_{axle}l"]) / track_m[axle]

    def linear(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> Linear:
        """The model's matrices."""
        step = self.motion.cell_s
        keep = np.exp([-step / noise["turn_s"], -step / noise["axle_s"], -step / noise["bank_s"], 0.0])
        size = np.array([noise["turn_rad_s"], noise["axle_rad_s"], noise["bank_mps2"], self._pair]) ** 2
        observe = np.zeros((len(self._y), 3, 4))
        observe[:, 0, :2] = 1.0
        observe[:, 0, 3] = self.motion.speed_mps
        observe[:, 1, 0] = 1.0 + sensor.get("yaw_gain", 0.0)
        observe[:, 2, 0] = (1.0 + sensor.get("ay_gain", 0.0)) * self.motion.speed_mps
        observe[:, 2, 2] = 1.0
        white = np.array([noise["axle_white_rad_s"], noise["yaw_rad_s"], noise["ay_mps2"]]) ** 2
        return Linear(np.diag(keep), np.diag(size * (1.0 - keep**2)), np.diag(size), observe, white)

    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, 3) and log-likelihood of every cell."""
        added = np.array([0.0, sensor.get("yaw_bias_rad_s", 0.0), sensor.get("ay_bias_mps2", 0.0)])
        return innovations(self._y - added, self._known, self.motion.fresh, self.linear(sensor, noise))

    def predicted(self, channel: str, sensor: Mapping[str, float]) -> Floats:
        """Yaw rate or lateral acceleration as the axle foretells it, over half a second; flat road."""
        motion, half = self.motion, max(round(0.25 / self.motion.cell_s), 1)
        turn = np.empty(len(motion.t_s))
        for k in range(len(motion.logs)):
            rows = motion.log == k
            values = np.nan_to_num(self._y[rows, 0])
            kernel = np.ones(2 * half + 1)
            turn[rows] = np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")
        if channel == "yaw_rate_rad_s":
            return (1.0 + sensor.get("yaw_gain", 0.0)) * turn + sensor.get("yaw_bias_rad_s", 0.0)
        return (1.0 + sensor.get("ay_gain", 0.0)) * motion.speed_mps * turn + sensor.get("ay_bias_mps2", 0.0)


def _together(difference: Floats, turn: Floats, motion: Motion) -> float:
    good = np.isfinite(difference) & np.isfinite(turn) & (motion.moving > 0.5)
    if good.sum() < 50 or np.ptp(turn[good]) == 0.0 or np.ptp(difference[good]) == 0.0:
        return 0.0
    return float(np.corrcoef(difference[good], turn[good])[0, 1])

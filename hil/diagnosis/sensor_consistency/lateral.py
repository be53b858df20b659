"""Lateral model: yaw rate and lateral acceleration against the difference of an axle's wheel speeds."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import StateSpace, log_likelihood
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.threshold import SPREAD

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
_PARAMETERS: Final[Mapping[str, Parameter]] = {
    "yaw_gain": Parameter(0.0, -12.0, 300.0, 0.05),
    "yaw_bias_rad_s": Parameter(0.0, -0.3, 0.3, 2e-3),
    "ay_gain": Parameter(0.0, -12.0, 300.0, 0.05),
    "ay_bias_mps2": Parameter(0.0, -3.0, 3.0, 0.05),
}


class LateralModel(SensorModel):
    """Axle, gyro and lateral accelerometer of one unknown yaw rate r.

    The axle reads (v_right - v_left) / track, the gyro r, the accelerometer v r. States: r, coloured error of the
    axle's difference, bank and side slip (m/s2), difference of the radii of the axle's wheels.

    Attributes
    ----------
    correlation : axle (``f``, ``r``) -> correlation of its wheel-speed difference with the sensors.
    axle : the one with the larger correlation, which is used: the wheels of a locked axle do not show the turn.
    nuisances : parameters that are fitted but never a cause (the road's crossfall).
    """

    noise = _NOISE

    def __init__(self, motion: Motion, track_m: Mapping[str, float]) -> None:
        self.motion = motion
        empty = np.full(len(motion.t_s), np.nan)
        yaw, ay = (motion.channels.get(name, empty) for name in ("yaw_rate_rad_s", "ay_mps2"))
        turn = yaw if np.isfinite(yaw).sum() > 50 else ay / np.maximum(motion.speed_mps, 1.0)
        axle_rate = {
            axle: np.asarray(motion.channels[f"wheel_{axle}r"] - motion.channels[f"wheel_{axle}l"]) / track_m[axle]
            for axle in "fr"
        }
        self.correlation = {axle: _correlation(rate, turn, motion) for axle, rate in axle_rate.items()}
        self.axle = max("rf", key=lambda axle: abs(self.correlation[axle]))
        self._y = np.column_stack([axle_rate[self.axle], yaw, ay])
        self._valid = np.isfinite(self._y) * motion.moving[:, None]
        sensors = [name for name, column in (("yaw", 1), ("ay", 2)) if self._valid[:, column].sum() > 50]
        self.nuisances = ("ay_bias_mps2",) if "ay" in sensors else ()
        self._radius_sigma = 2.0**0.5 * SPREAD / track_m[self.axle]
        self.parameters = {n: v for n, v in _PARAMETERS.items() if n.split("_")[0] in sensors}

    def state_space(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> StateSpace:
        """The model's matrices."""
        step = self.motion.cell_s
        ar1 = np.exp([-step / noise["turn_s"], -step / noise["axle_s"], -step / noise["bank_s"], 0.0])
        variance = np.array([noise["turn_rad_s"], noise["axle_rad_s"], noise["bank_mps2"], self._radius_sigma]) ** 2
        observation = np.zeros((len(self._y), 3, 4))
        observation[:, 0, :2] = 1.0
        observation[:, 0, 3] = self.motion.speed_mps
        observation[:, 1, 0] = 1.0 + parameters.get("yaw_gain", 0.0)
        observation[:, 2, 0] = (1.0 + parameters.get("ay_gain", 0.0)) * self.motion.speed_mps
        observation[:, 2, 2] = 1.0
        white = np.array([noise["axle_white_rad_s"], noise["yaw_rad_s"], noise["ay_mps2"]]) ** 2
        return StateSpace(np.diag(ar1), np.diag(variance * (1.0 - ar1**2)), np.diag(variance), observation, white)

    def log_likelihood(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> Floats:
        """(cells,) log-likelihood of axle, gyro and lateral accelerometer."""
        bias = np.array([0.0, parameters.get("yaw_bias_rad_s", 0.0), parameters.get("ay_bias_mps2", 0.0)])
        return log_likelihood(self._y - bias, self._valid, self.motion.log_start, self.state_space(parameters, noise))

    def predict(self, channel: str, parameters: Mapping[str, float]) -> Floats:
        """(cells,) yaw rate or lateral acceleration predicted from the axle's mean over half a second, flat road."""
        motion, half = self.motion, max(round(0.25 / self.motion.cell_s), 1)
        turn = np.empty(len(motion.t_s))
        for k in range(len(motion.logs)):
            rows = motion.log_id == k
            values = np.nan_to_num(self._y[rows, 0])
            kernel = np.ones(2 * half + 1)
            turn[rows] = np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")
        if channel == "yaw_rate_rad_s":
            return (1.0 + parameters.get("yaw_gain", 0.0)) * turn + parameters.get("yaw_bias_rad_s", 0.0)
        lateral = (1.0 + parameters.get("ay_gain", 0.0)) * motion.speed_mps * turn
        return np.asarray(lateral + parameters.get("ay_bias_mps2", 0.0))


def _correlation(difference: Floats, turn: Floats, motion: Motion) -> float:
    good = np.isfinite(difference) & np.isfinite(turn) & (motion.moving > 0.5)
    if good.sum() < 50 or np.ptp(turn[good]) == 0.0 or np.ptp(difference[good]) == 0.0:
        return 0.0
    return float(np.corrcoef(difference[good], turn[good])[0, 1])

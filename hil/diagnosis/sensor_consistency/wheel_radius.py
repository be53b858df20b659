"""Wheel-radius model: wheel speeds against each other, and against the ground speed where there is one."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.sensor_consistency.kalman import StateSpace, log_likelihood
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion

_NOISE: Final[Mapping[str, Parameter]] = {
    "slip": Parameter(0.002, 1e-5, 0.2, 0.3, True, 2.0),
    "slip_s": Parameter(0.5, 0.05, 20.0, 0.3, True, 1.0),
    "white": Parameter(0.002, 1e-5, 0.2, 0.3, True, 2.0),
}
_MIN_SPEED_MPS = 5.0


class WheelRadiusModel(SensorModel):
    """Each wheel's speed over the reference, less 1 and less the turn: scale, slip with the acceleration, noise.

    The reference is the ground speed where there is one, else the median wheel. Parameters ``fl``, ``fr``, ``rl``,
    ``rr`` are scales, ``all`` that of every wheel against the ground; ``slip_front`` and ``slip_rear`` (s2/m) are the
    slip of an axle per acceleration.

    Attributes
    ----------
    nuisances : parameters that are fitted but never a cause.
    """

    noise = _NOISE

    def __init__(self, motion: Motion, track_m: Mapping[str, float], yaw_rate_rad_s: Floats | None) -> None:
        self.motion = motion
        to_ground = motion.has("speed_mps")
        self._reference = motion.channels["speed_mps"] if to_ground else motion.speed_mps
        divisor = np.maximum(self._reference, 1.0)
        ratios = np.column_stack([motion.channels[f"wheel_{w}"] / divisor - 1.0 for w in WHEELS])
        half_track = 0.5 * np.array([-track_m["f"], track_m["f"], -track_m["r"], track_m["r"]])
        turn = np.zeros(len(divisor)) if yaw_rate_rad_s is None else np.nan_to_num(yaw_rate_rad_s / divisor)
        self._turn = turn[:, None] * half_track
        self._y = ratios - self._turn
        self._valid = np.isfinite(self._y) * (motion.moving * (self._reference > _MIN_SPEED_MPS))[:, None]
        self.nuisances = ("slip_front", "slip_rear", *(("all",) if to_ground else ()))
        self.parameters = {w: Parameter(0.0, -0.5, 0.5, 0.002) for w in WHEELS} | {
            n: Parameter(0.0, -0.1, 0.1, 0.001) for n in self.nuisances
        }

    def log_likelihood(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> Floats:
        """(cells,) log-likelihood of the four wheel speeds."""
        ar1 = float(np.exp(-self.motion.cell_s / noise["slip_s"]))
        scale = parameters.get("all", 0.0) + np.array([parameters.get(w, 0.0) for w in WHEELS])
        slip = np.array([parameters.get("slip_front", 0.0)] * 2 + [parameters.get("slip_rear", 0.0)] * 2)
        one, variance = np.eye(4), noise["slip"] ** 2
        model = StateSpace(
            ar1 * one, variance * (1.0 - ar1**2) * one, variance * one, one, np.full(4, noise["white"] ** 2)
        )
        y = self._y - scale - self.motion.accel_mps2[:, None] * slip
        return log_likelihood(y, self._valid, self.motion.log_start, model)

    def predict(self, wheel: str, parameters: Mapping[str, float]) -> Floats:
        """(cells,) a wheel's speed predicted from the reference and the turn, m/s."""
        slip = parameters.get("slip_front" if wheel[0] == "f" else "slip_rear", 0.0) * self.motion.accel_mps2
        scale = 1.0 + parameters.get("all", 0.0) + parameters.get(wheel, 0.0) + slip
        return np.asarray(self._reference * (scale + self._turn[:, WHEELS.index(wheel)]))

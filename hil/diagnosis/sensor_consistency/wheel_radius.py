"""Wheel against wheel, and all of them against the ground where somebody measures it: scales, that is rolling radii."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.sensor_consistency.kalman import Linear, innovations
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion

SPREAD = 0.002
"""Wheel-to-wheel spread of rolling radii that no tolerance needs to state: 0.12 % on comma2k19 (effects, 13)."""
_NOISE: Final[Mapping[str, Parameter]] = {
    "slip": Parameter(0.002, 1e-5, 0.2, 0.3, True, 2.0),
    "slip_s": Parameter(0.5, 0.05, 20.0, 0.3, True, 1.0),
    "white": Parameter(0.002, 1e-5, 0.2, 0.3, True, 2.0),
}
_FAST_MPS = 5.0


class WheelRadiusModel(SensorModel):
    """Each wheel's speed over the reference's, less 1 and less the turn: a scale, slip with the acceleration, noise.

    The reference is the ground speed where there is one, else the median wheel. Numbers ``fl``, ``fr``, ``rl``, ``rr``
    are scales, ``all`` that of every wheel against the ground; ``slip_front`` and ``slip_rear`` (s2/m) are what an axle
    gains with the acceleration.
    """

    noise = _NOISE

    def __init__(self, motion: Motion, track_m: Mapping[str, float], yaw_rate_rad_s: Floats | None) -> None:
        self.motion = motion
        self.to_ground = motion.has("speed_mps")
        speed = motion.channels["speed_mps"] if self.to_ground else motion.speed_mps
        fast = np.maximum(speed, 1.0)
        ratios = np.column_stack([motion.channels[f"wheel_{w}"] / fast - 1.0 for w in WHEELS])
        half = 0.5 * np.array([-track_m["f"], track_m["f"], -track_m["r"], track_m["r"]])
        turn = np.zeros(len(speed)) if yaw_rate_rad_s is None else np.nan_to_num(yaw_rate_rad_s / fast)
        self._reference, self._side = speed, turn[:, None] * half
        ratios -= self._side
        self._y = ratios
        self.unknown = ("slip_front", "slip_rear", *(("all",) if self.to_ground else ()))
        self._known = np.isfinite(ratios) * (motion.moving * (speed > _FAST_MPS))[:, None]
        self.parameters = {w: Parameter(0.0, -0.5, 0.5, 0.002) for w in WHEELS} | {
            n: Parameter(0.0, -0.1, 0.1, 0.001) for n in self.unknown
        }

    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, 4) and log-likelihood of every cell."""
        keep = float(np.exp(-self.motion.cell_s / noise["slip_s"]))
        added = sensor.get("all", 0.0) + np.array([sensor.get(w, 0.0) for w in WHEELS])
        slip = np.array([sensor.get("slip_front", 0.0)] * 2 + [sensor.get("slip_rear", 0.0)] * 2)
        one, size = np.eye(4), noise["slip"] ** 2
        model = Linear(keep * one, size * (1.0 - keep**2) * one, size * one, one, np.full(4, noise["white"] ** 2))
        y = self._y - added - self.motion.accel_mps2[:, None] * slip
        return innovations(y, self._known, self.motion.fresh, model)

    def predicted(self, wheel: str, sensor: Mapping[str, float]) -> Floats:
        """A wheel's speed as the reference, the turn and its numbers foretell it."""
        at = WHEELS.index(wheel)
        slip = sensor.get("slip_front" if wheel[0] == "f" else "slip_rear", 0.0) * self.motion.accel_mps2
        share = 1.0 + sensor.get("all", 0.0) + sensor.get(wheel, 0.0) + slip + self._side[:, at]
        return np.asarray(self._reference * share)

"""Pressure to deceleration: gain, delay, lag and drag that the motion supports, without any force being measured."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.signal import lfilter

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import Linear, innovations
from hil.diagnosis.sensor_consistency.longitudinal import lag
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion

_NOISE: Final[Mapping[str, Parameter]] = {
    "speed_mps": Parameter(0.03, 1e-4, 1.0, 0.3, True, 2.0),
    "force_mps2": Parameter(0.3, 1e-2, 10.0, 0.3, True, 1.5),
    "force_s": Parameter(2.0, 0.1, 100.0, 0.3, True, 1.0),
}
_NUMBERS: Final[Mapping[str, Parameter]] = {
    "brake_mps2_pa": Parameter(0.0, -1e-4, 1e-4, 1e-6),
    "delay_s": Parameter(0.0, -2.0, 2.0, 0.05),
    "lag_s": Parameter(0.0, 0.0, 1.0, 0.05),
    "drive_mps2": Parameter(0.0, -100.0, 100.0, 1.0),
    "drive_delay_s": Parameter(0.0, -2.0, 2.0, 0.05),
    "engine_mps2": Parameter(0.0, -10.0, 10.0, 0.2),
    "drag_mps2": Parameter(0.0, -10.0, 10.0, 0.2),
    "drag_1_m": Parameter(0.0, -0.02, 0.02, 2e-4),
    "offset_pa": Parameter(0.0, -5e6, 5e6, 1e4),
    "by_speed": Parameter(0.0, -3.0, 3.0, 0.1),
    "by_pressure": Parameter(0.0, -3.0, 3.0, 0.1),
}
_OFF, _GAINING_MPS2 = 0.01, 0.4
_REFERENCE = (20.0, 5e5)
LEAST_PA = 2e5
LEAST_STOPS = 3


class BrakingModel(SensorModel):
    """v' = -g p(t - delay) - engine - drag - c v^2 + drive throttle + force; force is coloured: slope, gear, model.

    ``brake_mps2_pa`` is g; ``by_speed`` and ``by_pressure`` change it in proportion to (v - 20 m/s)/20 and
    (p - 5 bar)/5; ``engine_mps2`` counts while the throttle is closed.
    """

    noise = _NOISE

    def __init__(self, motion: Motion, slip_s2_m: float = 0.0) -> None:
        """``slip_s2_m`` is how far the wheels slip per acceleration (`hil.diagnosis.sensor_consistency.longitudinal.SLIP`)."""
        self.motion = motion
        self.demanded = not motion.has("pressure")
        pressure = motion.channels["pressure_demand" if self.demanded else "pressure"]
        self.offset_pa, self.offset_sigma_pa = _zero(motion, pressure)
        self.pressure = np.nan_to_num(pressure - self.offset_pa)
        rolled = motion.speed_mps * (1.0 - slip_s2_m * motion.accel_mps2)
        self.speed = motion.channels["speed_mps"] if motion.has("speed_mps") else rolled
        self.throttle = np.nan_to_num(motion.channels["throttle"]) if motion.has("throttle") else None
        self._known = (np.isfinite(self.speed) * motion.moving)[:, None]
        without = () if self.throttle is not None else ("drive_mps2", "drive_delay_s", "engine_mps2")
        self.parameters = {n: v for n, v in _NUMBERS.items() if n not in without}
        self.stops = _stops(motion, self.pressure)

    def force(self, sensor: Mapping[str, float]) -> Floats:
        """Acceleration that the numbers explain, m/s2."""
        motion, v = self.motion, self.motion.speed_mps
        found = -sensor.get("brake_mps2_pa", 0.0) * self._clamped(sensor)
        found -= sensor.get("drag_mps2", 0.0) + sensor.get("drag_1_m", 0.0) * v * v
        if self.throttle is not None:
            throttle = self._later(self.throttle, sensor.get("drive_delay_s", 0.0))
            found += sensor.get("drive_mps2", 0.0) * throttle
            found -= sensor.get("engine_mps2", 0.0) * np.clip(1.0 - throttle / _OFF, 0.0, 1.0)
        return np.asarray(found * motion.moving)

    def _clamped(self, sensor: Mapping[str, float]) -> Floats:
        """Pressure as the wheels feel it, with what speed and pressure make of the gain."""
        motion = self.motion
        felt = self._later(self.pressure, sensor.get("delay_s", 0.0))
        phi, old, new = lag(sensor.get("lag_s", 0.0), motion.cell_s)
        if phi > 0.0:
            felt = _lagged(felt, motion.fresh, phi, old, new)
        v, p = _REFERENCE
        change = (
            sensor.get("by_speed", 0.0) * (motion.speed_mps - v) / v + sensor.get("by_pressure", 0.0) * (felt - p) / p
        )
        return np.asarray(felt * (1.0 + change))

    def _later(self, values: Floats, delay_s: float) -> Floats:
        found = np.empty_like(values)
        for k in range(len(self.motion.logs)):
            rows = self.motion.log == k
            found[rows] = np.interp(self.motion.t_s[rows] - delay_s, self.motion.t_s[rows], values[rows])
        return found

    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, 1) and log-likelihood of every cell."""
        step = self.motion.cell_s
        force = self.force(sensor)
        explained = np.cumsum(0.5 * step * (force + np.concatenate((force[:1], force[:-1]))))
        keep, size = float(np.exp(-step / noise["force_s"])), noise["force_mps2"] ** 2
        transition = np.array([[1.0, 0.5 * step * (1.0 + keep)], [0.0, keep]])
        into = np.array([[0.5 * step], [1.0]])
        model = Linear(
            transition, into @ into.T * size * (1.0 - keep**2), np.diag([1e6, size]), np.array([[1.0, 0.0]]),
            np.array([noise["speed_mps"] ** 2]),
        )  # fmt: skip
        return innovations((self.speed - explained)[:, None], self._known, self.motion.fresh, model)

    def free_run(self, sensor: Mapping[str, float], offset: Floats | float = 0.0) -> Floats:
        """Speed through every stop from its start, NaN elsewhere; ``offset`` is added to the force."""
        found, force = np.full(len(self.speed), np.nan), self.force(sensor) + offset
        for first, last in self.stops:
            steps = 0.5 * self.motion.cell_s * (force[first + 1 : last] + force[first : last - 1])
            found[first] = self.speed[first]
            found[first + 1 : last] = self.speed[first] + np.cumsum(steps)
        return found


def _lagged(values: Floats, fresh: Floats, phi: float, old: float, new: float) -> Floats:
    out = np.empty_like(values)
    begins = [*np.flatnonzero(fresh > 0.5), len(values)]
    for first, last in pairwise(begins):
        part = values[first:last]
        out[first:last], _ = lfilter([new, old], [1.0, -phi], part, zi=[old * part[0] + phi * part[0]])
    return out


def _zero(motion: Motion, pressure: Floats) -> tuple[float, float]:
    """What the pressure reads while the car gains speed, and how far the manoeuvres disagree on it."""
    free = (motion.accel_mps2 > _GAINING_MPS2) & (motion.moving > 0.5) & np.isfinite(pressure)
    values = [
        float(np.median(pressure[part])) for k in range(motion.blocks) if (part := free & (motion.block == k)).sum() > 5
    ]
    if len(values) < LEAST_STOPS:
        return 0.0, 0.0
    return float(np.median(values)), float(np.subtract(*np.quantile(values, (0.84, 0.16)))) * 0.5 * (
        len(values) - 1
    ) ** -0.5


def _stops(motion: Motion, pressure: Floats) -> list[tuple[int, int]]:
    """Applications of 0.8 s or more with ``LEAST_PA`` while the car moves, as cells from first to past the last."""
    on = (pressure > 2e4) & (motion.moving > 0.5)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], on.astype(np.int8), [0]))))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if (last - first) * motion.cell_s > 0.8 and pressure[first:last].max() > LEAST_PA:
            found.append((int(first), int(last)))
    return found

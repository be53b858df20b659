"""Braking model: deceleration from brake pressure, with gain, delay, lag and drag; no force is measured."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.signal import lfilter

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import StateSpace, log_likelihood
from hil.diagnosis.sensor_consistency.longitudinal import first_order_lag
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion
from hil.diagnosis.sensor_consistency.threshold import MIN_STOPS

_NOISE: Final[Mapping[str, Parameter]] = {
    "speed_mps": Parameter(0.03, 1e-4, 1.0, 0.3, True, 2.0),
    "force_mps2": Parameter(0.3, 1e-2, 10.0, 0.3, True, 1.5),
    "force_s": Parameter(2.0, 0.1, 100.0, 0.3, True, 1.0),
}
_PARAMETERS: Final[Mapping[str, Parameter]] = {
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
_CLOSED_THROTTLE, _GAINING_MPS2 = 0.01, 0.4
_REFERENCE_SPEED_MPS, _REFERENCE_PA = 20.0, 5e5
APPLIED_PA = 2e4
"""Pressure from which the brake counts as applied."""
_STOP_PA, _STOP_S = 2e5, 0.8
"""A stop reaches this pressure and lasts longer than this."""


class BrakingModel(SensorModel):
    """dv/dt = -g p(t - delay) - drag - c v^2 - engine + drive throttle + coloured force (slope, gear, model error).

    ``brake_mps2_pa`` is g; ``by_speed`` and ``by_pressure`` change it in proportion to (v - 20 m/s)/20 and
    (p - 5 bar)/5; ``engine_mps2`` acts while the throttle is closed.

    Attributes
    ----------
    pressure : (cells,) Pa, less its zero ``offset_pa``, which is known to ``offset_sigma_pa``.
    speed : (cells,) over ground, m/s.
    stops : first cell and the one after the last of every brake application that counts.
    """

    noise = _NOISE

    def __init__(self, motion: Motion, slip_s2_m: float = 0.0) -> None:
        """``slip_s2_m`` is the wheels' slip per acceleration (`longitudinal.SLIP`)."""
        self.motion = motion
        pressure = motion.channels["pressure" if motion.has("pressure") else "pressure_demand"]
        self.offset_pa, self.offset_sigma_pa = _zero_pressure(motion, pressure)
        self.pressure = np.nan_to_num(pressure - self.offset_pa)
        rolled = motion.speed_mps * (1.0 - slip_s2_m * motion.accel_mps2)
        self.speed = motion.channels["speed_mps"] if motion.has("speed_mps") else rolled
        self.throttle = np.nan_to_num(motion.channels["throttle"]) if motion.has("throttle") else None
        self._valid = (np.isfinite(self.speed) * motion.moving)[:, None]
        without = () if self.throttle is not None else ("drive_mps2", "drive_delay_s", "engine_mps2")
        self.parameters = {n: v for n, v in _PARAMETERS.items() if n not in without}
        self.stops = _stops(motion, self.pressure)

    def acceleration(self, parameters: Mapping[str, float]) -> Floats:
        """(cells,) acceleration that the parameters explain, m/s2; 0 where the car does not move."""
        motion, v = self.motion, self.motion.speed_mps
        accel = -parameters.get("brake_mps2_pa", 0.0) * self.effective_pressure(parameters)
        accel -= parameters.get("drag_mps2", 0.0) + parameters.get("drag_1_m", 0.0) * v * v
        if self.throttle is not None:
            throttle = motion.delayed(self.throttle, parameters.get("drive_delay_s", 0.0))
            accel += parameters.get("drive_mps2", 0.0) * throttle
            closed = np.clip(1.0 - throttle / _CLOSED_THROTTLE, 0.0, 1.0)
            accel -= parameters.get("engine_mps2", 0.0) * closed
        return np.asarray(accel * motion.moving)

    def effective_pressure(self, parameters: Mapping[str, float]) -> Floats:
        """(cells,) delayed and lagged pressure, times the gain's change with speed and pressure, Pa."""
        motion = self.motion
        pressure = motion.delayed(self.pressure, parameters.get("delay_s", 0.0))
        phi, b0, b1 = first_order_lag(parameters.get("lag_s", 0.0), motion.cell_s)
        if phi > 0.0:
            pressure = _lagged(pressure, motion.log_start, phi, b0, b1)
        change = (
            parameters.get("by_speed", 0.0) * (motion.speed_mps - _REFERENCE_SPEED_MPS) / _REFERENCE_SPEED_MPS
            + parameters.get("by_pressure", 0.0) * (pressure - _REFERENCE_PA) / _REFERENCE_PA
        )
        return np.asarray(pressure * (1.0 + change))

    def log_likelihood(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> Floats:
        """(cells,) log-likelihood of the speed."""
        step = self.motion.cell_s
        accel = self.acceleration(parameters)
        explained = np.cumsum(0.5 * step * (accel + np.concatenate((accel[:1], accel[:-1]))))
        ar1, variance = float(np.exp(-step / noise["force_s"])), noise["force_mps2"] ** 2
        transition = np.array([[1.0, 0.5 * step * (1.0 + ar1)], [0.0, ar1]])
        into = np.array([[0.5 * step], [1.0]])
        model = StateSpace(
            transition, into @ into.T * variance * (1.0 - ar1**2), np.diag([1e6, variance]), np.array([[1.0, 0.0]]),
            np.array([noise["speed_mps"] ** 2]),
        )  # fmt: skip
        return log_likelihood((self.speed - explained)[:, None], self._valid, self.motion.log_start, model)

    def predict(self, parameters: Mapping[str, float]) -> Floats:
        """(cells,) speed simulated open loop through every stop from its measured start, m/s; NaN elsewhere."""
        speed, accel = np.full(len(self.speed), np.nan), self.acceleration(parameters)
        for first, end in self.stops:
            steps = 0.5 * self.motion.cell_s * (accel[first + 1 : end] + accel[first : end - 1])
            speed[first] = self.speed[first]
            speed[first + 1 : end] = self.speed[first] + np.cumsum(steps)
        return speed


def _lagged(values: Floats, log_start: Floats, phi: float, b0: float, b1: float) -> Floats:
    lagged = np.empty_like(values)
    for first, end in pairwise([*np.flatnonzero(log_start > 0.5), len(values)]):
        part = values[first:end]
        lagged[first:end], _ = lfilter([b1, b0], [1.0, -phi], part, zi=[b0 * part[0] + phi * part[0]])
    return lagged


def _zero_pressure(motion: Motion, pressure: Floats) -> tuple[float, float]:
    """Pressure while the car gains speed, Pa: median over the segments, and its standard deviation; 0 if too few."""
    released = (motion.accel_mps2 > _GAINING_MPS2) & (motion.moving > 0.5) & np.isfinite(pressure)
    values = [
        float(np.median(pressure[rows]))
        for k in range(motion.segments)
        if (rows := released & (motion.segment_id == k)).sum() > 5
    ]
    if len(values) < MIN_STOPS:
        return 0.0, 0.0
    spread = float(np.subtract(*np.quantile(values, (0.84, 0.16))))
    return float(np.median(values)), spread * 0.5 * (len(values) - 1) ** -0.5


def _stops(motion: Motion, pressure: Floats) -> list[tuple[int, int]]:
    applied = (pressure > APPLIED_PA) & (motion.moving > 0.5)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], applied.astype(np.int8), [0]))))
    return [
        (int(first), int(end))
        for first, end in zip(edges[::2], edges[1::2], strict=True)
        if (end - first) * motion.cell_s > _STOP_S and pressure[first:end].max() > _STOP_PA
    ]

"""Longitudinal model: the accelerometer against the wheels' speed, with every error a sensor may have in between."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import StateSpace, log_likelihood
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel
from hil.diagnosis.sensor_consistency.motion import Motion, slope_of
from plant.vehicle import GRAVITY_MPS2

NOISE: Final[Mapping[str, Parameter]] = {
    "speed_mps": Parameter(0.02, 1e-4, 1.0, 0.3, True, 2.0),
    "motion_mps2": Parameter(1.0, 0.05, 20.0, 0.3, True, 2.0),
    "motion_s": Parameter(5.0, 0.1, 100.0, 0.3, True, 1.0),
    "motion_lag_s": Parameter(0.1, 0.005, 1.0, 0.3, True, 1.0),
    "slope_mps2": Parameter(0.2, 1e-4, 5.0, 0.3, True, 1.5),
    "slope_s": Parameter(10.0, 0.5, 100.0, 0.3, True, 0.7),
    "body_mps2": Parameter(0.1, 1e-4, 20.0, 0.3, True, 2.0),
    "body_s": Parameter(0.15, 0.02, 1.5, 0.3, True, 0.7),
    "ax_mps2": Parameter(0.05, 1e-4, 5.0, 0.3, True, 2.0),
}
"""White noise of the speed; size, correlation time and lag of the acceleration; the road's slope; pitch and vibration
of the body; white noise of the accelerometer.

Origins: roads of 1 to 3 % over some hundred metres (effects 1), pitch at 1 to 2 Hz (8), sensors (55 to 64).
"""

SENSOR: Final[Mapping[str, Parameter]] = {
    "gain": Parameter(0.0, -12.0, 300.0, 0.05),
    "bias_mps2": Parameter(0.0, -3.0, 3.0, 0.05),
    "filter_s": Parameter(0.0, 0.0, 6.0, 0.05),
    "delay_s": Parameter(0.0, -0.5, 0.5, 0.02),
    "drift_mps3": Parameter(0.0, -0.05, 0.05, 1e-3),
    "cross": Parameter(0.0, -0.5, 0.5, 0.02),
    "ahead_m": Parameter(0.0, -3.0, 3.0, 0.3),
    "beside_m": Parameter(0.0, -2.0, 2.0, 0.2),
}
"""Errors of the accelerometer: ax(t + delay_s) = (1 + gain) lowpass(a + g slope; filter_s) + bias_mps2 + drift_mps3 t
+ cross ay - ahead_m r^2 - beside_m dr/dt, r being the yaw rate."""

SLIP = "slip_s2_m"
"""Slip of the wheels per specific force f, s2/m: at speed v they read v (1 + slip f). A nuisance parameter."""
_MAX_SLIP, _MIN_SHARE = 0.03, 0.01
"""Bound of the slip; smallest standard deviation of the tyres' stiffness, as a share of it."""
_DIFFUSE_VARIANCE = 1e4
_SPEED, _ACCEL, _SLOPE, _FELT, _LAST, _BODY, _PULL = range(7)


def first_order_lag(time_s: float, step_s: float) -> tuple[float, float, float]:
    """phi, b0, b1 of f[t+1] = phi f[t] + b0 u[t] + b1 u[t+1], the lag T df/dt = u - f for piecewise linear u.

    Exact; Franklin, Powell, Workman, Digital Control of Dynamic Systems, first-order hold.
    """
    if time_s < 1e-6:
        return 0.0, 0.0, 1.0
    phi = float(np.exp(-step_s / time_s))
    share = (1.0 - phi) * time_s / step_s
    return phi, share - phi, 1.0 - share


class LongitudinalModel(SensorModel):
    """Wheel speed and accelerometer of one unknown acceleration.

    States: speed, acceleration, slope (m/s2), filtered specific force and its last value, motion of the body on its
    suspension, and the force per mass that drives the acceleration. Channels: speed, accelerometer.
    """

    noise = NOISE
    channel = "ax_mps2"

    def __init__(self, motion: Motion, slip: Parameter | None = None) -> None:
        """``slip`` is the prior of `SLIP`; None where the speed is over ground."""
        self.motion = motion
        cells = len(motion.t_s)
        ay, yaw_rate = motion.channels.get("ay_mps2"), motion.channels.get("yaw_rate_rad_s")
        self._regressors: dict[str, Floats] = {"bias_mps2": np.ones(cells), "drift_mps3": motion.t_s}
        if ay is not None and (motion.moving > 0.5).sum() > 50:
            self._regressors["cross"] = np.nan_to_num(ay)
        if yaw_rate is not None:
            rate = np.nan_to_num(yaw_rate)
            self._regressors["ahead_m"] = -(rate**2)
            self._regressors["beside_m"] = -np.gradient(rate, motion.cell_s) * (motion.log_start < 0.5)
        self.parameters = {n: v for n, v in SENSOR.items() if n in {"gain", "filter_s", "delay_s", *self._regressors}}
        self.parameters |= {SLIP: slip} if slip else {}
        self.resolution = {"delay_s": 0.5 * motion.cell_s}
        margin = round(SENSOR["delay_s"].high / motion.cell_s) + 1  # the same cells count whatever the delay
        ends = np.maximum(motion.log_start, np.concatenate((motion.log_start[1:], [1.0])))
        near = np.convolve(ends, np.ones(2 * margin + 1))[margin : margin + len(ends)]
        inside = 1.0 - np.minimum(near, 1.0)
        self._valid = np.column_stack([motion.moving, motion.moving * inside])

    def state_space(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> StateSpace:
        """The model's matrices."""
        step, one = self.motion.cell_s, np.eye(7)
        ar1 = {n: float(np.exp(-step / noise[f"{n}_s"])) for n in ("motion", "slope", "body")}
        transition, into = np.eye(7), np.zeros((7, 3))  # next state from this one, and from three white noises
        for state, name, source in ((_PULL, "motion", 0), (_SLOPE, "slope", 1), (_BODY, "body", 2)):
            transition[state, state], into[state, source] = ar1[name], 1.0
        for state, inputs, time_s in (
            (_ACCEL, [_PULL], noise["motion_lag_s"]),
            (_FELT, [_ACCEL, _SLOPE], parameters.get("filter_s", 0.0)),
        ):
            phi, b0, b1 = first_order_lag(time_s, step)
            transition[state] = phi * one[state] + b0 * one[inputs].sum(axis=0) + b1 * transition[inputs].sum(axis=0)
            into[state] = b1 * into[inputs].sum(axis=0)
        transition[_SPEED] = one[_SPEED] + 0.5 * step * (one[_ACCEL] + transition[_ACCEL])
        into[_SPEED] = 0.5 * step * into[_ACCEL]
        transition[_LAST] = one[_FELT]
        sizes = [noise["motion_mps2"], noise["slope_mps2"], noise["body_mps2"]]
        driven = np.diag([size**2 * (1.0 - k * k) for size, k in zip(sizes, ar1.values(), strict=True)])
        felt = sizes[0] ** 2 + sizes[1] ** 2
        initial = np.diag([_DIFFUSE_VARIANCE, sizes[0] ** 2, sizes[1] ** 2, felt, 0.0, sizes[2] ** 2, sizes[0] ** 2])
        initial[_ACCEL, _PULL] = initial[_PULL, _ACCEL] = sizes[0] ** 2
        initial[_LAST, [_FELT, _LAST]] = initial[_FELT, _LAST] = felt
        gain, (_, share) = 1.0 + parameters.get("gain", 0.0), self._shift(parameters)
        observation = np.zeros((len(self.motion.speed_mps), 2, 7))
        observation[:, 0, _SPEED] = 1.0
        observation[:, 0, [_ACCEL, _SLOPE]] = parameters.get(SLIP, 0.0) * self.motion.speed_mps[:, None]
        observation[:, 1, [_FELT, _LAST, _BODY]] = gain * (1.0 - share), gain * share, 1.0
        variance = np.array([noise["speed_mps"] ** 2, noise["ax_mps2"] ** 2])
        return StateSpace(transition, into @ driven @ into.T, initial, observation, variance)

    def _shift(self, parameters: Mapping[str, float]) -> tuple[int, float]:
        """The delay as whole cells, by which the data are shifted, and a share of one, which the model interpolates.

        Interpolated data would have less noise, and any delay would be likely.
        """
        cells = parameters.get("delay_s", 0.0) / self.motion.cell_s
        whole = math.floor(cells)
        return whole, cells - whole

    def _additive(self, parameters: Mapping[str, float]) -> Floats:
        """(cells,) all that is added to the accelerometer, m/s2."""
        terms = (parameters.get(name, 0.0) * regressor for name, regressor in self._regressors.items())
        return sum(terms, np.zeros(len(self.motion.t_s)))

    def log_likelihood(self, parameters: Mapping[str, float], noise: Mapping[str, float]) -> Floats:
        """(cells,) log-likelihood of wheel speed and accelerometer."""
        values = self.motion.advanced(self.channel, self._shift(parameters)[0])
        y = np.column_stack([self.motion.speed_mps, values - self._additive(parameters)])
        valid = self._valid * np.isfinite(y)
        return log_likelihood(y, valid, self.motion.log_start, self.state_space(parameters, noise))

    def predict(self, parameters: Mapping[str, float]) -> Floats:
        """(cells,) accelerometer predicted from the wheels' motion alone on a flat road, m/s2."""
        motion = self.motion
        phi, b0, b1 = first_order_lag(parameters.get("filter_s", 0.0), motion.cell_s)
        slipped = parameters.get(SLIP, 0.0) * motion.speed_mps * motion.accel_mps2
        force = motion.accel_mps2 - slope_of(slipped, motion.log_id, motion.cell_s)
        filtered, last = np.empty_like(force), 0.0
        for k, u in enumerate(force):
            last = u if motion.log_start[k] > 0.5 else phi * last + b0 * force[k - 1] + b1 * u
            filtered[k] = last
        read = (1.0 + parameters.get("gain", 0.0)) * filtered + self._additive(parameters)
        return motion.delayed(read, parameters.get("delay_s", 0.0))


def slip_prior(stiffness: float, share: float) -> Parameter:
    """Prior of `SLIP` for tyres that give ``stiffness`` times the load per slip, with standard deviation ``share``.

    Slip is proportional to the force (effects 16); all wheels drive or brake in proportion to their load.
    """
    typical = 1.0 / (GRAVITY_MPS2 * stiffness)
    return Parameter(typical, 0.0, _MAX_SLIP, 0.1 * typical, prior=max(share, _MIN_SHARE) * typical)

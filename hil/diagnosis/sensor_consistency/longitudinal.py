"""Along the car: the accelerometer against the wheels' speed, with all that a sensor may do in between."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.kalman import Linear, innovations
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
"""White noise of the speed; the motion itself and how fast it changes; the road's slope; pitch and vibration; white
noise of the accelerometer.

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
"""What the accelerometer may do: ax' = (1 + gain) lowpass(a + g slope) + bias + ..., ``delay_s`` after its stamp."""

SLIP = "slip_s2_m"
"""Slip of the wheels per specific force, s2/m: of a speed v they tell v (1 + slip f). Nobody is accused of it."""
_MOST_SLIP, _LEAST_SHARE = 0.03, 0.01
"""Most slip that is looked for; and how well a stiffness is known at best: a share of none would be no knowledge."""
_UNKNOWN = 1e4
_SPEED, _ACCEL, _SLOPE, _FELT, _LAST, _BODY, _PULL = range(7)


def lag(time_s: float, step_s: float) -> tuple[float, float, float]:
    """f' = phi f + old u + new u' of the lag T df/dt = u - f where u is a straight line between samples.

    Exact; Franklin, Powell, Workman, Digital Control of Dynamic Systems, first-order hold.
    """
    if time_s < 1e-6:
        return 0.0, 0.0, 1.0
    phi = float(np.exp(-step_s / time_s))
    share = (1.0 - phi) * time_s / step_s
    return phi, share - phi, 1.0 - share


class LongitudinalModel(SensorModel):
    """The model along the car.

    States: speed, acceleration, slope (m/s2), filtered specific force and its last value, the body's shaking, and what
    pulls the car.
    """

    noise = NOISE
    channel = "ax_mps2"

    def __init__(self, motion: Motion, slip: Parameter | None = None) -> None:
        """``slip`` is what is known of `SLIP` before; None where the speed is that over ground."""
        self.motion = motion
        rows = motion.moving > 0.5
        ay = motion.channels.get("ay_mps2")
        yaw = motion.channels.get("yaw_rate_rad_s")
        self._added: dict[str, Floats] = {"bias_mps2": np.ones(len(rows)), "drift_mps3": motion.t_s}
        if ay is not None and rows.sum() > 50:
            self._added["cross"] = np.nan_to_num(ay)
        if yaw is not None:
            turn = np.nan_to_num(yaw)
            self._added["ahead_m"] = -(turn**2)
            self._added["beside_m"] = -np.gradient(turn, motion.cell_s) * (motion.fresh < 0.5)
        self.parameters = {n: v for n, v in SENSOR.items() if n in {"gain", "filter_s", "delay_s", *self._added}}
        self.parameters |= {SLIP: slip} if slip else {}
        self.resolution = {"delay_s": 0.5 * motion.cell_s}
        edges = round(SENSOR["delay_s"].high / motion.cell_s) + 1  # the same cells whatever the delay
        inside = 1.0 - np.minimum(np.convolve(_ends(motion), np.ones(2 * edges + 1), "same"), 1.0)
        self._known = np.column_stack([motion.moving, motion.moving * inside])

    def linear(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> Linear:
        """The model's matrices."""
        step = self.motion.cell_s
        keep = {n: float(np.exp(-step / noise[f"{n}_s"])) for n in ("motion", "slope", "body")}
        now, into = np.eye(7), np.zeros((7, 3))  # next state of this one, and of the three white sources
        for state, name, source in ((_PULL, "motion", 0), (_SLOPE, "slope", 1), (_BODY, "body", 2)):
            now[state, state], into[state, source] = keep[name], 1.0
        for state, inputs, time_s in (
            (_ACCEL, [_PULL], noise["motion_lag_s"]),
            (_FELT, [_ACCEL, _SLOPE], sensor.get("filter_s", 0.0)),
        ):
            phi, old, new = lag(time_s, step)
            now[state] = phi * np.eye(7)[state] + old * np.eye(7)[inputs].sum(axis=0) + new * now[inputs].sum(axis=0)
            into[state] = new * into[inputs].sum(axis=0)
        now[_SPEED] = np.eye(7)[_SPEED] + 0.5 * step * (np.eye(7)[_ACCEL] + now[_ACCEL])
        into[_SPEED] = 0.5 * step * into[_ACCEL]
        now[_LAST] = np.eye(7)[_FELT]
        sizes = [noise["motion_mps2"], noise["slope_mps2"], noise["body_mps2"]]
        driven = np.diag([size**2 * (1.0 - k * k) for size, k in zip(sizes, keep.values(), strict=True)])
        felt = sizes[0] ** 2 + sizes[1] ** 2
        start = np.diag([_UNKNOWN, sizes[0] ** 2, sizes[1] ** 2, felt, 0.0, sizes[2] ** 2, sizes[0] ** 2])
        start[_ACCEL, _PULL] = start[_PULL, _ACCEL] = sizes[0] ** 2
        start[_LAST, [_FELT, _LAST]] = start[_FELT, _LAST] = felt
        gain, (_, share) = 1.0 + sensor.get("gain", 0.0), self._shift(sensor)
        observe = np.zeros((len(self.motion.speed_mps), 2, 7))
        observe[:, 0, _SPEED] = 1.0
        observe[:, 0, [_ACCEL, _SLOPE]] = sensor.get(SLIP, 0.0) * self.motion.speed_mps[:, None]
        observe[:, 1, [_FELT, _LAST, _BODY]] = gain * (1.0 - share), gain * share, 1.0
        white = np.array([noise["speed_mps"] ** 2, noise["ax_mps2"] ** 2])
        return Linear(now, into @ driven @ into.T, start, observe, white)

    def _shift(self, sensor: Mapping[str, float]) -> tuple[int, float]:
        """A delay as whole cells, which move the data, and a share of one, which the model interpolates.

        The data are never interpolated: that would make their noise smaller, and any delay likely.
        """
        cells = sensor.get("delay_s", 0.0) / self.motion.cell_s
        whole = math.floor(cells)
        return whole, cells - whole

    def measured(self, sensor: Mapping[str, float]) -> Floats:
        """Speed and accelerometer, the latter at the time it was felt and less all that is added to it."""
        values = self.motion.later(self.channel, self._shift(sensor)[0])
        added = sum((sensor.get(name, 0.0) * column for name, column in self._added.items()), np.zeros(len(values)))
        return np.column_stack([self.motion.speed_mps, values - added])

    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, 2) and log-likelihood of every cell."""
        y = self.measured(sensor)
        known = self._known * np.isfinite(y)
        return innovations(y, known, self.motion.fresh, self.linear(sensor, noise))

    def predicted(self, sensor: Mapping[str, float]) -> Floats:
        """The accelerometer as the wheels' motion alone foretells it; flat road."""
        motion = self.motion
        phi, old, new = lag(sensor.get("filter_s", 0.0), motion.cell_s)
        slipped = sensor.get(SLIP, 0.0) * motion.speed_mps * motion.accel_mps2
        force = motion.accel_mps2 - slope_of(slipped, motion.log, motion.cell_s)
        found = np.empty_like(force)
        now = 0.0
        for k, u in enumerate(force):
            now = u if motion.fresh[k] > 0.5 else phi * now + old * force[k - 1] + new * u
            found[k] = now
        added = sum((sensor.get(name, 0.0) * column for name, column in self._added.items()), np.zeros(len(force)))
        found = (1.0 + sensor.get("gain", 0.0)) * found + added
        late = sensor.get("delay_s", 0.0)
        for k in range(len(motion.logs)):
            rows = motion.log == k
            found[rows] = np.interp(motion.t_s[rows] - late, motion.t_s[rows], found[rows])
        return found


def known_slip(stiffness: float, share: float) -> Parameter:
    """What is known of `SLIP` of tyres that give ``stiffness`` times the load per slip, known to a ``share`` of it.

    Slip in proportion to the force (effects 16); all wheels pull or brake as they are loaded.
    """
    usual = 1.0 / (GRAVITY_MPS2 * stiffness)
    return Parameter(usual, 0.0, _MOST_SLIP, 0.1 * usual, prior=max(share, _LEAST_SHARE) * usual)


def _ends(motion: Motion) -> Floats:
    """1 in the first and the last cell of every log."""
    return np.maximum(motion.fresh, np.concatenate((motion.fresh[1:], [1.0])))

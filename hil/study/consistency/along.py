"""Along the car: the accelerometer against the wheels' speed, with all that a sensor may do in between."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.study.consistency.kalman import Linear, innovations
from hil.study.consistency.model import Model, Number
from hil.study.consistency.motion import Motion
from hil.study.table import Floats

NOISE: Final[Mapping[str, Number]] = {
    "speed_mps": Number(0.02, 1e-4, 1.0, 0.3, True, 2.0),
    "motion_mps2": Number(1.0, 0.05, 20.0, 0.3, True, 2.0),
    "motion_s": Number(5.0, 0.1, 100.0, 0.3, True, 1.0),
    "slope_mps2": Number(0.2, 1e-4, 5.0, 0.3, True, 1.5),
    "slope_s": Number(10.0, 0.5, 100.0, 0.3, True, 0.7),
    "body_mps2": Number(0.1, 1e-4, 20.0, 0.3, True, 2.0),
    "body_s": Number(0.15, 0.02, 1.5, 0.3, True, 0.7),
    "ax_mps2": Number(0.05, 1e-4, 5.0, 0.3, True, 2.0),
}
"""White noise of the speed; the motion itself; the road's slope; pitch and vibration; white noise of the accelerometer.

Origins: roads of 1 to 3 % over some hundred metres (effects 1), pitch at 1 to 2 Hz (8), sensors (55 to 64).
"""

SENSOR: Final[Mapping[str, Number]] = {
    "gain": Number(0.0, -12.0, 300.0, 0.05),
    "bias_mps2": Number(0.0, -3.0, 3.0, 0.05),
    "filter_s": Number(0.0, 0.0, 6.0, 0.05),
    "delay_s": Number(0.0, -0.5, 0.5, 0.02),
    "drift_mps3": Number(0.0, -0.05, 0.05, 1e-3),
    "cross": Number(0.0, -0.5, 0.5, 0.02),
    "ahead_m": Number(0.0, -3.0, 3.0, 0.3),
    "beside_m": Number(0.0, -2.0, 2.0, 0.2),
}
"""What the accelerometer may do: ax' = (1 + gain) lowpass(a + g slope) + bias + ..., ``delay_s`` after its stamp."""

_UNKNOWN = 1e4


def lag(time_s: float, step_s: float) -> tuple[float, float, float]:
    """f' = phi f + old u + new u' of the lag T df/dt = u - f where u is a straight line between samples.

    Exact; Franklin, Powell, Workman, Digital Control of Dynamic Systems, first-order hold.
    """
    if time_s < 1e-6:
        return 0.0, 0.0, 1.0
    phi = float(np.exp(-step_s / time_s))
    share = (1.0 - phi) * time_s / step_s
    return phi, share - phi, 1.0 - share


class Along(Model):
    """The model along the car: states speed, acceleration, slope (m/s2), filtered specific force, body's shaking."""

    noise = NOISE
    channel = "ax_mps2"

    def __init__(self, motion: Motion) -> None:
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
        self.numbers = {n: v for n, v in SENSOR.items() if n in {"gain", "filter_s", "delay_s", *self._added}}
        self._known = np.column_stack([motion.moving, motion.known(self.channel)])

    def linear(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> Linear:
        """The model's matrices."""
        step = self.motion.cell_s
        a, s, c = (float(np.exp(-step / noise[n])) for n in ("motion_s", "slope_s", "body_s"))
        phi, old, new = lag(sensor.get("filter_s", 0.0), step)
        delay = sensor.get("delay_s", 0.0)
        hold, past, now = lag(0.5 * abs(delay), step)
        row = np.zeros((6, 6))  # of the next state, in terms of this one
        row[0, :2] = 1.0, 0.5 * step * (1.0 + a)
        row[1, 1], row[2, 2], row[5, 5] = a, s, c
        row[3, 1:4] = old + new * a, old + new * s, phi
        into = np.zeros((6, 3))  # of motion, slope, body
        into[:2, 0] = 0.5 * step, 1.0
        into[2, 1] = 1.0
        into[3, :2] = new
        into[5, 2] = 1.0
        of = 3 if delay >= 0.0 else 0  # a delay of the accelerometer, or of the speed
        row[4] = now * row[of]
        row[4, of] += past
        row[4, 4] += hold
        into[4] = now * into[of]
        sizes = [noise["motion_mps2"], noise["slope_mps2"], noise["body_mps2"]]
        driven = np.diag([size**2 * (1.0 - p * p) for size, p in zip(sizes, (a, s, c), strict=True)])
        felt = sizes[0] ** 2 + sizes[1] ** 2
        start = np.diag([_UNKNOWN, sizes[0] ** 2, sizes[1] ** 2, felt, 0.0, sizes[2] ** 2])
        start[4] = start[of]
        start[:, 4] = start[:, of]
        start[4, 4] = start[of, of]
        gain = 1.0 + sensor.get("gain", 0.0)
        observe = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, gain, 0.0, 1.0]])
        passed = 1.0 if of == 0 else gain  # all-pass of first order (Pade): 2 lag - 1
        observe[0 if of == 0 else 1, [of, 4]] = -passed, 2.0 * passed
        white = np.array([noise["speed_mps"] ** 2, noise["ax_mps2"] ** 2])
        return Linear(row, into @ driven @ into.T, start, observe, white)

    def measured(self, sensor: Mapping[str, float]) -> Floats:
        """Speed and accelerometer, the latter at the time it was felt and less all that is added to it."""
        values = self.motion.channels[self.channel]
        added = sum((sensor.get(name, 0.0) * column for name, column in self._added.items()), np.zeros(len(values)))
        return np.column_stack([self.motion.speed_mps, values - added])

    def score(self, sensor: Mapping[str, float], noise: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Innovations (cells, 2) and log-likelihood of every cell."""
        return innovations(self.measured(sensor), self._known, self.motion.fresh, self.linear(sensor, noise))

    def predicted(self, sensor: Mapping[str, float]) -> Floats:
        """The accelerometer as the wheels' motion alone foretells it; flat road."""
        motion = self.motion
        phi, old, new = lag(sensor.get("filter_s", 0.0), motion.cell_s)
        force = motion.accel_mps2
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

"""How visible a hidden cause is: what it changes, whitened by the noise, beside what tolerances explain."""

from collections.abc import Sequence
from math import exp, log

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hil.validation.strangers.car import Cause, Hidden, Noise, StrangerCar, Table, Vector, Vehicle

WHEELS = tuple(f"wheel_speed_{w}_rad_s" for w in ("fl", "fr", "rl", "rr"))
SHARED = (*WHEELS, "ax_mps2", "speed_mps")
"""Channels that share force, slope and speed of the body."""
MOTION = ("wheel_speed_", "ax_", "ay_", "yaw_", "speed_", "motor_torque_")
SLOW_RAD_S, MOVES_RAD_S = 10.0, 0.3
START_MPS = 0.05
BY_SPEED = {"ay_mps2": 1.7, "yaw_rate_rad_s": 0.7}
"""Powers of the speed that a bend goes with: an answer to another speed tells no more than the speed."""
ROUNDS, WITHIN = 40, 0.002


class Visibility:
    """What is hidden in the drive of a seed, against its noise and what its stated set leaves open.

    Parameters
    ----------
    stated : the set that the owner writes for the drive.
    """

    def __init__(self, car: StrangerCar, seed: int, stated: Vehicle) -> None:
        self._car, self._seed = car, seed
        self._base = car.drive(seed, noisy=False)
        self._whitener = Whitener(self._base, car.noise(seed))
        off = [car.drive(seed, noisy=False, off=number) for number in car.tolerated(stated)]
        self._imitations = np.stack([self._whitened(tables) for tables in off], axis=1)
        self._inner = self._imitations.T @ self._imitations + np.eye(self._imitations.shape[1])

    def snr(self, hidden: Hidden) -> float:
        """Signal-to-noise ratio beside imitations by the tolerated numbers."""
        signal = self._whitened(self._car.drive(self._seed, hidden, noisy=False))
        along = self._imitations.T @ signal
        return float(max(float(signal @ signal - along @ np.linalg.solve(self._inner, along)), 0.0) ** 0.5)

    def sized(self, cause: Cause, target: float) -> tuple[Hidden, float]:
        """The cause at the size with a wanted ratio, and its ratio; at an end of its range where that is not inside."""
        low, high = (Hidden(cause.name, size) for size in (cause.smallest, cause.largest))
        for end, beyond in ((low, 1.0), (high, -1.0)):
            found = self.snr(end)
            if beyond * (found - target) >= 0.0:
                return end, found
        for _ in range(ROUNDS):
            middle = Hidden(cause.name, low.size * (high.size / low.size) ** 0.5)
            found = self.snr(middle)
            if abs(log(max(found, 1e-9) / target)) < WITHIN:
                break
            low, high = (middle, high) if found < target else (low, middle)
        return middle, found

    def _whitened(self, tables: Sequence[Table]) -> Vector:
        return self._whitener(difference(tables, self._base))


def difference(one: Sequence[Table], other: Sequence[Table]) -> list[dict[str, Vector]]:
    """``one`` less ``other``, log by log, as long as ``other`` goes.

    The motion counts until either car is slow: who stands first is no signature. NaN from there on.
    """
    result = []
    for a, b in zip(one, other, strict=True):
        rows, rolling = len(b["t_s"]), min(_rolling(a), _rolling(b))
        apart = {}
        for name in b:
            both = min(len(a[name]), rows)
            full = np.zeros(rows)
            full[:both] = a[name][:both] - b[name][:both]
            if name.startswith(MOTION):
                full[rolling:] = np.nan
            apart[name] = full
        result.append(apart)
    return result


def _speed(table: Table) -> Vector:
    """Mean of the wheels, rad/s; rows without a sample keep the last one."""
    mean = np.mean([table[name] for name in WHEELS], axis=0)
    told = np.flatnonzero(np.isfinite(mean))
    return np.interp(np.arange(mean.size), told, mean[told]) if told.size else np.zeros(mean.size)


def _rolling(table: Table) -> int:
    """Rows until the car is slow; all where it began so."""
    slow = _speed(table) < SLOW_RAD_S
    return len(slow) if slow[0] or not slow.any() else int(np.argmax(slow))


class Whitener:
    """Turns difference tables into innovations under a drive's noise: independent, standard deviation 1.

    `SHARED` channels go through one Kalman filter (speed, gust, slope, own coloured noise of each), all others with
    white noise through one of their own. Its gains do not depend on what is shown, and are found once.
    """

    def __init__(self, base: Sequence[Table], noise: Noise) -> None:
        self._base, self._noise = base, noise
        self._radius_m = _radius_m(base)
        self._filters = [self._filter(table) for table in base]

    def __call__(self, differences: Sequence[Table]) -> Vector:
        """Innovations of all channels and logs; 0 where nothing is measured."""
        parts = []
        for apart, table, (keep, moving, step_s, gains, deviations) in zip(
            differences, self._base, self._filters, strict=True
        ):
            missing = np.full(len(moving), np.nan)
            shown = np.stack([apart.get(name, missing) for name in SHARED], axis=1)
            parts.append(_shared_innovations(shown, keep, moving, step_s, self._radius_m, gains, deviations).ravel())
            wheels = np.nan_to_num([apart[name] for name in WHEELS]).mean(axis=0)
            faster = wheels / np.maximum(_speed(table), 1.0)
            for name, white in self._noise.white.items():
                if name not in SHARED and name in apart:
                    answer = BY_SPEED.get(name, 0.0) * faster * np.nan_to_num(table[name])
                    parts.append(_innovations(apart[name] - answer, white, *_coloured(self._noise, name, step_s)))
        return np.concatenate(parts)

    def _filter(self, table: Table) -> tuple[Vector, Vector, float, Vector, Vector]:
        noise, step_s = self._noise, float(np.median(np.diff(table["t_s"])))
        moving = (_speed(table) > MOVES_RAD_S).astype(np.float64)
        slow = [(size, exp(-step_s / tau_s)) for size, tau_s in (noise.gust_mps2, noise.slope_mps2)]
        size, keep = np.array([(START_MPS, 1.0), *slow, *(_coloured(noise, name, step_s) for name in SHARED)]).T
        there = np.stack([np.isfinite(table[name]) if name in table else moving < 0.0 for name in SHARED], axis=1)
        white = np.array([noise.white.get(name, np.inf) for name in SHARED])
        gains, deviations = _gains(there & np.isfinite(white), white, size, keep, moving, step_s, self._radius_m)
        return keep, moving, step_s, gains, deviations


def _radius_m(base: Sequence[Table]) -> float:
    """Way per angle, from the ground speed where it is logged, else a usual one."""
    found = [
        np.nanmedian(table["speed_mps"][fast] / _speed(table)[fast])
        for table in base
        if "speed_mps" in table and (fast := _speed(table) > SLOW_RAD_S).any()
    ]
    return float(np.median(found)) if found else 0.32


def _coloured(noise: Noise, name: str, step_s: float) -> tuple[float, float]:
    """Standard deviation, and what is left of it after a row."""
    size, tau_s = noise.coloured.get(name, (0.0, 1.0))
    return size, exp(-step_s / tau_s)


@njit(cache=True, error_model="numpy")
def _innovations(z: Vector, white: float, drift: float, keep: float) -> Vector:
    """Normalised innovations of a channel with white and first-order noise."""
    out = np.zeros(z.size)
    state, variance = 0.0, drift * drift
    for k in range(z.size):
        if z[k] == z[k]:
            s = variance + white * white
            out[k] = (z[k] - state) / s**0.5
            gain = variance / s
            state += gain * (z[k] - state)
            variance -= gain * variance
        state *= keep
        variance = keep * keep * variance + (1.0 - keep * keep) * drift * drift
    return out


@njit(cache=True, error_model="numpy")
def _sees(j: int, moving: float, radius_m: float, h: Vector) -> None:
    """What channel ``j`` of `SHARED` sees of the states: speed, gust, slope, coloured noise of each channel."""
    h[:] = 0.0
    h[3 + j] = 1.0
    if j == 4:
        h[1] = moving
    else:
        h[0] = 1.0 / radius_m if j < 4 else 1.0


@njit(cache=True, error_model="numpy")
def _gains(
    there: NDArray[np.bool_], white: Vector, size: Vector, keep: Vector, moving: Vector, step_s: float, radius_m: float
) -> tuple[Vector, Vector]:
    """Kalman gains (n, 6, 9) and standard deviations of the innovations (n, 6); inf where no sample is ``there``."""
    n, m = moving.size, size.size
    gains, deviations = np.zeros((n, 6, m)), np.full((n, 6), np.inf)
    h, g, p = np.zeros(m), np.zeros(m), np.diag(size**2)
    for k in range(n):
        for j in range(6):
            if not there[k, j]:
                continue
            _sees(j, moving[k], radius_m, h)
            s = white[j] * white[j]
            for a in range(m):
                g[a] = 0.0
                for b in range(m):
                    g[a] += p[a, b] * h[b]
                s += h[a] * g[a]
            deviations[k, j] = s**0.5
            gains[k, j] = g / s
            for a in range(m):
                for b in range(m):
                    p[a, b] -= g[a] * g[b] / s
        step = step_s * moving[k]
        for b in range(m):
            p[0, b] += step * (p[1, b] - p[2, b])
        for a in range(m):
            p[a, 0] += step * (p[a, 1] - p[a, 2])
        for i in range(1, m):
            for b in range(m):
                p[i, b] *= keep[i]
                p[b, i] *= keep[i]
            p[i, i] += (1.0 - keep[i] ** 2) * size[i] ** 2
        p[0, 0] += 1e-14
    return gains, deviations


@njit(cache=True, error_model="numpy")
def _shared_innovations(
    shown: Vector, keep: Vector, moving: Vector, step_s: float, radius_m: float, gains: Vector, deviations: Vector
) -> Vector:
    """Normalised innovations of `SHARED`, (n, 6); where a log's motion ends, nothing is shown from there on."""
    n, m = moving.size, keep.size
    out, x, h = np.zeros((n, 6)), np.zeros(m), np.zeros(m)
    for k in range(n):
        for j in range(6):
            z = shown[k, j]
            if z != z:
                continue
            _sees(j, moving[k], radius_m, h)
            for a in range(m):
                z -= h[a] * x[a]
            out[k, j] = z / deviations[k, j]
            for a in range(m):
                x[a] += gains[k, j, a] * z
        x[0] += step_s * moving[k] * (x[1] - x[2])
        for i in range(1, m):
            x[i] *= keep[i]
    return out

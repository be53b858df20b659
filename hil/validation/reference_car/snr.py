"""How visible a hidden thing is: distance of two runs, whitened by the noise, beside what tolerances imitate."""

from collections.abc import Mapping, Sequence
from math import exp

import numpy as np
from numpy.typing import NDArray

from hil.validation.reference_car.car import NOMINAL
from hil.validation.reference_car.compiled import entry
from hil.validation.reference_car.manoeuvres import TICK_S
from hil.validation.reference_car.noise import QUANTUM, Noise

Vector = NDArray[np.float64]
Table = Mapping[str, Vector]
WHEELS = ("fl", "fr", "rl", "rr")
START_MPS, RADIUS_M = 0.05, NOMINAL.rolling_radius_m
SLOW_RAD_S = 10.0
LAG_ROWS = 6  # in which a motor has reached what it may give
CLEAR_NM = 5.0  # by which a motor at a limit gives less than demanded; a torque that passes zero does so by less
RAMP_NM = 0.95 * NOMINAL.motor_rate_limit_nm_s * TICK_S  # a row
NEAR_ROWS = 20  # about the moment a motor meets a limit
SAME_SPEED = 0.005  # share of the speed beyond which a bend is another bend
_BY_SPEED = {"ay_mps2": 1.7, "yaw_rate_rad_s": 0.7}
"""Powers of the speed that a bend goes with at usual speeds; 2 and 1 for a car without understeer."""
WAITING = 2.0**0.5  # a frame against the stamp of another node's: two waiting times, exponential and independent
MOTION = ("wheel_speed_", "ax_", "ay_", "yaw_", "speed_", "motor_torque_")


def whitened(differences: Sequence[Table], base: Sequence[Table], noise: Noise) -> Vector:
    """Innovations of difference tables under the noise of the case; independent, standard deviation 1.

    Wheel speeds, accelerometer and satellite speed share force, slope and speed of the body: one Kalman filter whitens
    them together. All other channels have white and coloured noise of their own.
    """
    parts = []
    for apart, table in zip(differences, base, strict=True):
        omega = np.stack([table[f"wheel_speed_{w}_rad_s"] for w in WHEELS], axis=1)
        wheel_sd = np.hypot(noise.wheel_rad_s + noise.wheel_share * np.abs(omega), noise.order_share * omega)
        wheel_sd = np.hypot(wheel_sd, QUANTUM["wheel"] / 12**0.5)
        names = [f"wheel_speed_{w}_rad_s" for w in WHEELS] + ["ax_mps2", "speed_mps"]
        motion = np.stack([apart[name] for name in names], axis=1)
        moving = (omega.mean(axis=1) > 0.3).astype(np.float64)
        coloured = np.array([noise.gust_mps2, noise.slope_mps2, noise.drift_mps2, *[noise.wheel_drift] * 4])
        times = np.array([noise.gust_tau_s, noise.slope_tau_s, noise.drift_tau_s, *[noise.sensor_tau_s] * 4])
        torque, unclear = _answered(apart, table, omega)
        known = torque.sum(axis=1) / (NOMINAL.rolling_radius_m * NOMINAL.mass_kg)
        waits = WAITING * noise.queue_s
        ax_sd = _taken_late(_deviation(noise.ax_mps2, "ax"), table["ax_mps2"], waits)
        parts.append(
            _motion_innovations(
                motion, omega, wheel_sd, ax_sd, _deviation(noise.speed_mps, "speed"), moving, known, coloured,
                np.exp(-TICK_S / times),
            ).ravel()
        )  # fmt: skip
        keep = exp(-TICK_S / noise.sensor_tau_s)
        own = [
            ("ay_mps2", noise.ay_mps2, noise.ay_drift_mps2),
            ("yaw_rate_rad_s", noise.yaw_rad_s, noise.yaw_drift_rad_s),
        ]
        own += [(f"pressure_{w}_pa", noise.pressure_pa, noise.pressure_drift_pa) for w in WHEELS]
        for i, w in enumerate(WHEELS):
            own_torque = np.where(unclear[:, i], np.nan, apart[f"motor_torque_{w}_nm"] - torque[:, i])
            torque_sd = _taken_late(_deviation(noise.torque_nm, "motor"), table[f"motor_torque_{w}_nm"], 2.0 * waits)
            parts.append(_innovations(own_torque, torque_sd, noise.torque_drift_nm, keep))
        faster = np.nan_to_num(motion[:, :4].mean(axis=1)) / np.maximum(omega.mean(axis=1), 1.0)
        for name, white, drift in own:
            shown = apart[name]
            if name in _BY_SPEED:  # a bend answers another speed
                shown = np.where(np.abs(faster) > SAME_SPEED, np.nan, shown - _BY_SPEED[name] * faster * table[name])
            late = 2.0 * waits if name.startswith("pressure") else waits
            own_sd = _taken_late(_deviation(white, name.split("_")[0]), table[name], late)
            parts.append(_innovations(shown, own_sd, drift, keep))
    return np.concatenate(parts)


def _answered(apart: Table, table: Table, omega: Vector) -> tuple[Vector, NDArray[np.bool_]]:
    """Motor torque that only answers another speed, (n, 4): no signature, but what the motion has to be cleared of.

    The driver who holds a speed shows in the demand. Where a motor gives clearly less than demanded, its torque follows
    the fading at low speed, T / (v - v0), or constant power, -T / omega. Torque gets there with the motor's lag; while
    it goes as fast as it may, two torques stay as far apart as they are. True where that is no linear matter: where
    braking fades, and about the moments a limit is met or left.
    """
    result, unclear = np.zeros_like(omega), np.zeros(omega.shape, dtype=bool)
    keep = exp(-TICK_S / NOMINAL.motor_time_constant_s)
    for i, w in enumerate(WHEELS):
        torque, demand = table[f"motor_torque_{w}_nm"], table[f"motor_torque_demand_{w}_nm"]
        speed, turned = omega[:, i] * NOMINAL.rolling_radius_m, np.nan_to_num(apart[f"wheel_speed_{w}_rad_s"])
        settled = np.minimum(np.abs(demand), np.abs(np.concatenate([demand[:1].repeat(LAG_ROWS), demand[:-LAG_ROWS]])))
        short = np.abs(torque) < np.minimum(0.97 * settled, settled - CLEAR_NM)
        fades = short & (speed < NOMINAL.motor_fade_start_mps)
        over = np.maximum(speed - NOMINAL.motor_fade_end_mps, 0.2)
        aimed = (
            np.where(fades, torque / over * NOMINAL.rolling_radius_m, -torque / np.maximum(omega[:, i], 1.0)) * turned
        )
        aimed = np.where(short, aimed, np.nan_to_num(apart[f"motor_torque_demand_{w}_nm"]))
        result[:, i] = _with_lag(aimed, np.abs(np.diff(torque, append=torque[-1:])) > RAMP_NM, keep)
        met = np.convolve(np.abs(np.diff(short, prepend=short[:1])), np.ones(2 * NEAR_ROWS + 1), mode="same") > 0.5
        unclear[:, i] = fades | (met & (np.abs(turned) > 0.0))
    return result, unclear


@entry
def _with_lag(aimed: Vector, ramp: NDArray[np.bool_], keep: float) -> Vector:
    """Difference of torques that go for targets ``aimed`` apart; ``keep`` is left after a row, all where they ramp."""
    found = np.empty_like(aimed)
    now = aimed[0] if aimed.size else 0.0
    for k in range(aimed.size):
        found[k] = now
        now = now if ramp[k] else keep * now + (1.0 - keep) * aimed[k]
    return found


def difference(one: Sequence[Table], other: Sequence[Table]) -> list[dict[str, Vector]]:
    """``one`` less ``other``, log by log, as long as ``other`` goes.

    The motion counts until either car comes to rest: who stands first is no signature. NaN from there on.
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


def _rolling(table: Table) -> int:
    """Rows until the car comes to rest; all where it stood from the start."""
    slow = np.mean([table[f"wheel_speed_{w}_rad_s"] for w in WHEELS], axis=0) < SLOW_RAD_S
    return len(slow) if slow[0] or not slow.any() else int(np.argmax(slow))


def signal_to_noise(signal: Vector, imitations: Vector) -> tuple[float, float]:
    """Expected SNR of a whitened signal: beside imitations by parameters in their tolerance, and alone.

    Parameters
    ----------
    imitations : (samples, parameters), whitened, one standard deviation of each parameter.
    """
    alone = float(signal @ signal)
    if imitations.size == 0:
        return alone**0.5, alone**0.5
    along = imitations.T @ signal
    inner = imitations.T @ imitations + np.eye(imitations.shape[1])
    return max(alone - float(along @ np.linalg.solve(inner, along)), 0.0) ** 0.5, alone**0.5


def _taken_late(deviation: float, values: Vector, late_s: float) -> Vector:
    """White noise of a channel with what its slope makes of a frame that waits, (rows,).

    One frame tells all four wheels, so what it waits does not average out among them: it counts twice in each.
    """
    slope = np.gradient(np.nan_to_num(values), TICK_S) if len(values) > 1 else np.zeros(len(values))
    return np.asarray(np.hypot(deviation, late_s * slope))


def _deviation(white: float, channel: str) -> float:
    return float(np.hypot(white, QUANTUM[channel] / 12**0.5))


@entry
def _innovations(z: Vector, white: Vector, drift: float, keep: float) -> Vector:
    """Normalised innovations of one channel with white and AR(1) noise; 0 where nothing is measured."""
    out = np.zeros(z.size)
    state, variance = 0.0, drift * drift
    for k in range(z.size):
        if z[k] == z[k]:
            s = variance + white[k] * white[k]
            out[k] = (z[k] - state) / s**0.5
            gain = variance / s
            state += gain * (z[k] - state)
            variance -= gain * variance
        state *= keep
        variance = keep * keep * variance + (1.0 - keep * keep) * drift * drift
    return out


@entry
def _motion_innovations(
    motion: Vector, omega: Vector, wheel_sd: Vector, ax_sd: Vector, speed_sd: float, moving: Vector,
    known: Vector, coloured: Vector, keep: Vector,
) -> Vector:  # fmt: skip
    """Normalised innovations, (n, 6): wheels, accelerometer, satellite; NaN is no measurement and gives 0.

    ``known`` is acceleration by torque that answers the speed.
    States: speed; force, slope, accelerometer (AR(1)); share of each wheel (AR(1)). Kalman filter, scalar updates.
    """
    n, m = motion.shape[0], 8
    out, x, h, g = np.zeros((n, 6)), np.zeros(m), np.zeros(m), np.zeros(m)
    p = np.zeros((m, m))
    p[0, 0] = START_MPS**2
    for i in range(7):
        p[1 + i, 1 + i] = coloured[i] ** 2
    for k in range(n):
        for j in range(6):
            z = motion[k, j]
            if z != z:
                continue
            h[:] = 0.0
            if j < 4:
                h[0], h[4 + j], sd = 1.0 / RADIUS_M, omega[k, j], wheel_sd[k, j]
            elif j == 4:
                h[1], h[3], sd = moving[k], 1.0, ax_sd[k]
                z -= known[k] * moving[k]
            else:
                h[0], sd = 1.0, speed_sd
            s = sd * sd
            for a in range(m):
                g[a] = 0.0
                for b in range(m):
                    g[a] += p[a, b] * h[b]
                s += h[a] * g[a]
                z -= h[a] * x[a]
            out[k, j] = z / s**0.5
            for a in range(m):
                x[a] += g[a] * z / s
                for b in range(m):
                    p[a, b] -= g[a] * g[b] / s
        step = TICK_S * moving[k]
        x[0] += step * (x[1] - x[2] + known[k])
        for b in range(m):
            p[0, b] += step * (p[1, b] - p[2, b])
        for a in range(m):
            p[a, 0] += step * (p[a, 1] - p[a, 2])
        for i in range(7):
            x[1 + i] *= keep[i]
            for b in range(m):
                p[1 + i, b] *= keep[i]
                p[b, 1 + i] *= keep[i]
            p[1 + i, 1 + i] += (1.0 - keep[i] ** 2) * coloured[i] ** 2
        p[0, 0] += 1e-14
    return out

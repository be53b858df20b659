"""How visible a hidden thing is: distance of two runs, whitened by the true noise, beside what tolerances can imitate."""

from collections.abc import Mapping, Sequence
from math import exp

import numpy as np
from numpy.typing import NDArray

from hil.hide.compiled import entry
from hil.hide.manoeuvres import TICK_S
from hil.hide.noise import QUANTUM, Noise

Vector = NDArray[np.float64]
Table = Mapping[str, Vector]
WHEELS = ("fl", "fr", "rl", "rr")
START_MPS = 0.05
RADIUS_M = 0.308
SLOW_RAD_S = 5.0
MOTION = ("wheel_speed_", "ax_", "ay_", "yaw_", "speed_")


def whitened(differences: Sequence[Table], base: Sequence[Table], noise: Noise) -> Vector:
    """Innovations of difference tables under the noise of the case; independent, standard deviation 1.

    Wheel speeds, accelerometer and satellite speed share the coloured force on the body: a Kalman filter with speed and
    force as states whitens them together. All other channels have white noise.
    """
    parts = []
    for difference, table in zip(differences, base, strict=True):
        omega = np.stack([table[f"wheel_speed_{w}_rad_s"] for w in WHEELS], axis=1)
        rows = len(difference["t_s"])
        omega = omega[:rows]
        order = noise.order_share * omega
        wheel_sd = np.hypot(noise.wheel_rad_s + noise.wheel_share * np.abs(omega), order)
        wheel_sd = np.hypot(wheel_sd, QUANTUM["wheel"] / 12**0.5)
        motion = np.empty((rows, 6))
        for i, w in enumerate(WHEELS):
            motion[:, i] = difference[f"wheel_speed_{w}_rad_s"]
        motion[:, 4], motion[:, 5] = difference["ax_mps2"], difference["speed_mps"]
        moving = (omega.mean(axis=1) > 0.3).astype(np.float64)
        parts.append(
            _innovations(
                motion, wheel_sd, _deviation(noise.ax_mps2, "ax"), _deviation(noise.speed_mps, "speed"), moving,
                noise.gust_mps2, exp(-TICK_S / noise.gust_tau_s),
            ).ravel()
        )  # fmt: skip
        parts.append(difference["ay_mps2"] / np.hypot(_deviation(noise.ay_mps2, "ay"), noise.gust_mps2))
        parts.append(difference["yaw_rate_rad_s"] / _deviation(noise.yaw_rad_s, "yaw"))
        for w in WHEELS:
            parts.append(difference[f"pressure_{w}_pa"] / _deviation(noise.pressure_pa, "pressure"))
            parts.append(difference[f"motor_torque_{w}_nm"] / _deviation(noise.torque_nm, "motor"))
    return np.nan_to_num(np.concatenate(parts))


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


def _deviation(white: float, channel: str) -> float:
    return float(np.hypot(white, QUANTUM[channel] / 12**0.5))


@entry
def _innovations(
    motion: Vector, wheel_sd: Vector, ax_sd: float, speed_sd: float, moving: Vector, gust: float, keep: float
) -> Vector:
    """Normalised innovations, (n, 6): wheels, accelerometer, satellite; states are speed and coloured force.

    Kalman filter with scalar updates; NaN is no measurement.
    """
    n = motion.shape[0]
    out = np.zeros((n, 6))
    v, w = 0.0, 0.0
    pvv, pvw, pww = START_MPS**2, 0.0, gust * gust
    for k in range(n):
        for j in range(6):
            hv, hw, sd = 0.0, 0.0, 1.0
            if j < 4:
                hv, sd = 1.0 / RADIUS_M, wheel_sd[k, j]
            elif j == 4:
                hw, sd = moving[k], ax_sd
            else:
                hv, sd = 1.0, speed_sd
            z = motion[k, j]
            if z != z:
                continue
            s = hv * hv * pvv + 2.0 * hv * hw * pvw + hw * hw * pww + sd * sd
            gv, gw = (pvv * hv + pvw * hw) / s, (pvw * hv + pww * hw) / s
            residual = z - hv * v - hw * w
            out[k, j] = residual / s**0.5
            v += gv * residual
            w += gw * residual
            pvv, pvw, pww = pvv - gv * gv * s, pvw - gv * gw * s, pww - gw * gw * s
        step = TICK_S * moving[k]
        v += step * w
        w *= keep
        pvv, pvw = pvv + 2.0 * step * pvw + step * step * pww, keep * (pvw + step * pww)
        pww = keep * keep * pww + (1.0 - keep * keep) * gust * gust
        pvv += 1e-14
    return out

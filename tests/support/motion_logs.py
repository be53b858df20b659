"""A car whose forces nobody measured: one minute of accelerations in steps on a hilly road, with shaking and noise."""

import numpy as np

from hil.diagnosis.data.log import WHEEL_SPEED, Log, make_log

RADIUS_M, STEP_S = 0.33, 0.01


def coloured(rng: np.random.Generator, n: int, size: float, time_s: float) -> np.ndarray:
    """AR(1) noise of this standard deviation and time constant."""
    keep = np.exp(-STEP_S / time_s)
    out, white = np.zeros(n), size * np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    for k in range(1, n):
        out[k] = keep * out[k - 1] + white[k]
    return out


def motion_log(seed: int, gain: float = 0.0, late: int = 0) -> Log:
    """An accelerometer of scale ``1 + gain``, ``late`` rows behind, beside four wheel speeds."""
    rng, n = np.random.default_rng(seed), 6000
    levels = rng.uniform(-2.0, 2.0, 20)
    levels -= levels.mean()
    pull = np.repeat(levels, n // 20)
    kernel = np.exp(-np.arange(200) * STEP_S / 0.15)
    accel = np.convolve(pull, kernel / kernel.sum())[:n]
    speed = 20.0 + np.cumsum(accel) * STEP_S
    felt = accel + coloured(rng, n, 0.2, 8.0) + coloured(rng, n, 0.1, 0.15)
    ax = (1.0 + gain) * np.concatenate((felt[:1].repeat(late), felt[: n - late])) + 0.05 * rng.standard_normal(n)
    channels = {name: (speed + 0.02 * rng.standard_normal(n)) / RADIUS_M for name in WHEEL_SPEED}
    return make_log("made", np.arange(n) * STEP_S, channels | {"ax_mps2": ax})

"""Likelihoods over lanes are those of the filters that whiten, lane by lane."""

import numpy as np
import pytest

from hil.study.likelihoods import coloured_each, moving_each
from hil.study.whiten import coloured, moving

STEP_S, SAMPLES, LANES = 0.02, 400, 5


def _marks(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Where a log begins, and where some samples are missing."""
    fresh = np.zeros(SAMPLES)
    fresh[[0, 250]] = 1.0
    return fresh, (rng.random(SAMPLES) < 0.8) * 1.0


def test_one_track() -> None:
    rng = np.random.default_rng(1)
    fresh, known = _marks(rng)
    y = rng.standard_normal(SAMPLES)
    y[100] = 40.0  # beyond what is squared
    white, keep, colour = 0.1 + rng.random((SAMPLES, LANES)), rng.uniform(0.5, 0.99, LANES), rng.random(LANES)
    each = coloured_each(y, fresh, known, white, keep, colour)
    out = np.empty((SAMPLES, 1))
    alone = [coloured(y[:, None], fresh, known * white[:, k], keep[k], colour[k], out) for k in range(LANES)]
    assert each == pytest.approx(alone, rel=1e-9)


def test_the_moving_car() -> None:
    rng = np.random.default_rng(2)
    fresh, rolling = _marks(rng)
    restart = np.zeros(SAMPLES)
    restart[[120, 300]] = 1.0
    y, known = rng.standard_normal((SAMPLES, 3)), (rng.random((SAMPLES, 3)) < 0.8) * 1.0
    y[100, 1] = 40.0
    white, share = 0.01 + rng.random((SAMPLES, 3)), rng.random(SAMPLES)
    keep, colour = rng.uniform(0.5, 0.99, (4, LANES)), rng.random((4, LANES))
    sensor = rng.random((3, LANES))
    each = moving_each(y, fresh, restart, rolling, known, white, share, STEP_S, keep, colour, sensor)
    out = np.empty((SAMPLES, 3, 1))
    alone = [
        moving(
            y[:, :, None], fresh, restart, rolling, known * (white + sensor[:, k]), share, STEP_S,
            np.stack((keep[:, k], colour[:, k]), axis=1), out,
        )
        for k in range(LANES)
    ]  # fmt: skip
    assert each == pytest.approx(alone, rel=1e-9)

"""Likelihoods of many noises are those of the filters that whiten, noise by noise."""

import numpy as np
import pytest

from hil.diagnosis.noise.estimate import information_matrix
from hil.diagnosis.noise.innovations import (
    channel_innovations,
    channel_likelihoods,
    longitudinal_innovations,
    longitudinal_likelihoods,
)

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
    white, phi, colour = 0.1 + rng.random((SAMPLES, LANES)), rng.uniform(0.5, 0.99, LANES), rng.random(LANES)
    off, size = np.zeros((SAMPLES, LANES)), np.ones((SAMPLES, LANES))
    each = channel_likelihoods(y[:, None], np.ones(SAMPLES), fresh, known, white, phi, colour, off, size)
    out = np.empty((SAMPLES, 1))
    for k in range(LANES):
        alone = channel_innovations(y[:, None], np.ones(SAMPLES), fresh, known * white[:, k], phi[k], colour[k], out)
        assert each[k] == pytest.approx(alone, rel=1e-9)
        assert off[:, k] / np.sqrt(size[:, k]) == pytest.approx(out[:, 0], rel=1e-9)


def test_the_moving_car() -> None:
    rng = np.random.default_rng(2)
    fresh, rolling = _marks(rng)
    restart = np.zeros(SAMPLES)
    restart[[120, 300]] = 1.0
    y, known = rng.standard_normal((SAMPLES, 3)), (rng.random((SAMPLES, 3)) < 0.8) * 1.0
    y[100, 1] = 40.0
    white, share = 0.01 + rng.random((SAMPLES, 3)), rng.random(SAMPLES)
    phi, colour = rng.uniform(0.5, 0.99, (4, LANES)), rng.random((4, LANES))
    sensor = rng.random((3, LANES))
    off, size = np.zeros((3, SAMPLES, LANES)), np.ones((3, SAMPLES, LANES))
    tracks = tuple(np.ascontiguousarray(y[:, m : m + 1]) for m in range(3))
    ones = np.ones(SAMPLES)
    each = longitudinal_likelihoods(
        tracks, ones, fresh, restart, rolling, known, white, share, STEP_S, phi, colour, sensor, off, size
    )
    out = tuple(np.empty((SAMPLES, 1)) for _ in tracks)
    for k in range(LANES):
        alone = longitudinal_innovations(
            tracks, ones, fresh, restart, rolling, known * (white + sensor[:, k]), share, STEP_S,
            phi[:, k : k + 1].copy(), colour[:, k : k + 1].copy(), out,
        )  # fmt: skip
        assert each[k] == pytest.approx(alone, rel=1e-9)
        normalised = off[:, :, k] / np.sqrt(size[:, :, k])
        assert np.allclose(normalised.T, np.hstack(out), rtol=1e-9, atol=0.0)


def test_information_is_what_innovations_and_variances_change() -> None:
    """Of white noise whose level is unknown: n / 2 of the log of the variance."""
    rng = np.random.default_rng(3)
    step, count = 1e-4, 5000
    off = np.stack([rng.standard_normal(count)] * 2, axis=1)
    size = np.ones((count, 2)) * np.exp([0.0, step])
    assert information_matrix(off, size, 6.0)[0, 0] / step**2 == pytest.approx(count / 2, rel=1e-3)
    off[:, 1] += step  # a mean shifts all samples, one far off counts less
    off[0, 0] += 60.0
    off[0, 1] += 60.0
    assert information_matrix(off, np.ones((count, 2)), 6.0)[0, 0] / step**2 == pytest.approx(count - 0.9, abs=0.02)

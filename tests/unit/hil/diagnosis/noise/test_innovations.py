"""The noise model: innovations are white with variance 1, and without it they are not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hil.diagnosis.noise.innovations import channel_innovations, longitudinal_innovations

STEP_S = 0.02


def _ar1(n: int, size: float, tau_s: float, rng: np.random.Generator) -> np.ndarray:
    phi = np.exp(-STEP_S / tau_s)
    return lfilter([1.0], [1.0, -phi], size * np.sqrt(1.0 - phi * phi) * rng.standard_normal(n))


def test_coloured_noise_becomes_white() -> None:
    rng, n = np.random.default_rng(1), 20000
    y = (_ar1(n, 0.5, 0.4, rng) + 0.2 * rng.standard_normal(n))[:, None]
    fresh, white, out = np.zeros(n), np.full(n, 0.04), np.empty((n, 1))
    fresh[0] = 1.0
    channel_innovations(y, np.ones(n), fresh, white, np.exp(-STEP_S / 0.4), 0.25, out)
    assert out.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(out[1:, 0], out[:-1, 0])[0, 1]) < 0.03


def _moving_car(n: int, rng: np.random.Generator) -> np.ndarray:
    force = _ar1(n, 0.05, 1.0, rng)
    y = np.zeros((n, 3, 1))
    y[:, 0, 0] = np.cumsum(force) * STEP_S + 0.01 * rng.standard_normal(n)
    y[:, 1, 0] = force + 0.02 * rng.standard_normal(n)
    return y


def _moved(y, fresh, rolling, white, share, colours, out) -> None:
    """The filter over (samples, 3 tracks, 1), without a restart."""
    tracks = tuple(np.ascontiguousarray(y[:, m]) for m in range(3))
    outs = tuple(np.empty_like(track) for track in tracks)
    phi, colour = np.ascontiguousarray(colours.T)[:, :, None]
    longitudinal_innovations(
        tracks, np.ones(len(y)), fresh, np.zeros(len(y)), rolling, white, share, STEP_S, phi, colour, outs
    )
    out[:] = np.stack(outs, axis=1)


def _innovations(y: np.ndarray, force: float) -> np.ndarray:
    n = len(y)
    fresh, white, out = np.zeros(n), np.tile([1e-4, 4e-4, 0.0], (n, 1)), np.empty_like(y)
    fresh[0] = 1.0
    colours = np.array([[np.exp(-STEP_S), force**2], [0.5, 1e-12], [0.5, 1e-12], [0.5, 1e-12]])
    _moved(y, fresh, np.ones(n), white, np.ones(n), colours, out)
    return out[:, :2, 0]


def test_a_force_disturbance_shows_in_speed_and_acceleration_as_one() -> None:
    out = _innovations(_moving_car(10000, np.random.default_rng(2)), 0.05)
    assert out[10:].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    assert abs(np.corrcoef(out[10:].T)[0, 1]) < 0.05


def test_without_the_disturbance_in_the_model_nothing_is_white() -> None:
    out = _innovations(_moving_car(10000, np.random.default_rng(2)), 1e-6)
    assert out[10:, 0].std() > 3.0


def test_what_all_wheels_tell_wrong_is_no_motion() -> None:
    """A coloured error of the wheels with its weight is white after the filter, and leaves the ground speed alone."""
    n, rng = 10000, np.random.default_rng(4)
    share = np.linspace(0.5, 1.5, n)
    wrong = _ar1(n, 0.02, 1.0, rng)
    y = np.zeros((n, 3, 1))
    y[:, 0, 0] = share * wrong + 0.005 * rng.standard_normal(n)
    y[:, 2, 0] = 0.01 * rng.standard_normal(n)
    fresh, white, out = np.zeros(n), np.tile([2.5e-5, 0.0, 1e-4], (n, 1)), np.empty_like(y)
    fresh[0] = 1.0
    colours = np.array([[0.5, 1e-12], [0.5, 1e-12], [0.5, 1e-12], [np.exp(-STEP_S), 0.02**2]])
    _moved(y, fresh, np.ones(n), white, share, colours, out)
    assert out[10:, [0, 2], 0].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.05)
    assert abs(np.corrcoef(out[11:, 0, 0], out[10:-1, 0, 0])[0, 1]) < 0.05


def test_what_is_not_measured_leaves_nothing() -> None:
    y, out = np.ones((50, 1)), np.ones((50, 1))
    channel_innovations(y, np.ones(50), np.zeros(50), np.zeros(50), 0.9, 1.0, out)
    assert not out.any()


def test_a_car_held_at_rest_feels_no_gust() -> None:
    """A constant error of the accelerometer shows at rest by its own noise alone, however large the gusts are."""
    n = 500
    y, out = np.zeros((n, 3, 1)), np.empty((n, 3, 1))
    y[:, 1] = 0.05
    fresh, white = np.zeros(n), np.tile([1e-4, 4e-4, 0.0], (n, 1))
    fresh[0] = 1.0
    colours = np.array([[0.98, 0.5**2], [0.98, 0.5**2], [0.98, 1e-12], [0.5, 1e-12]])
    shown = []
    for rolling in (np.ones(n), np.zeros(n)):
        _moved(y, fresh, rolling, white, np.ones(n), colours, out)
        shown.append(float(np.square(out[:, 1]).sum()))
    assert shown[1] == pytest.approx(n * 0.05**2 / 4e-4, rel=1e-3)
    assert shown[0] < 0.2 * shown[1]

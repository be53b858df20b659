"""Size and colour of residuals on noise whose size and colour are known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hil.identify.noise import Noise, coloured, difference_noise, measure_noise

N = 20000


def first_order(rho, seed=3):
    rng = np.random.default_rng(seed)
    return lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], rng.standard_normal(N))


def test_white_noise_is_found_white():
    noise = measure_noise(2.0 * np.random.default_rng(1).standard_normal(N), np.zeros(N))
    assert noise.rms == pytest.approx(2.0, rel=0.03)
    assert noise.white
    assert noise.colour == 0.0
    assert noise.independent(N) == N


@pytest.mark.parametrize("rho", [0.5, 0.9, 0.98])
def test_colour_and_memory_of_first_order_noise(rho):
    noise = measure_noise(first_order(rho), np.zeros(N))
    assert not noise.white
    assert noise.memory == pytest.approx(rho, abs=0.03)
    assert noise.colour == pytest.approx(1.0, abs=0.06)
    assert noise.independent(N) == pytest.approx(N * (1 - rho) / (1 + rho), rel=0.4)


def test_white_noise_on_top_does_not_hide_the_memory():
    mixed = np.sqrt(0.5) * (first_order(0.95) + np.random.default_rng(7).standard_normal(N))
    noise = measure_noise(mixed, np.zeros(N))
    assert noise.memory == pytest.approx(0.95, abs=0.03)
    assert noise.colour == pytest.approx(0.5, abs=0.06)


def test_nothing_left_is_white_and_of_no_size():
    noise = measure_noise(np.zeros(N), np.ones(N))
    assert (noise.rms, noise.floor, noise.colour) == (0.0, 0.0, 0.0)
    assert noise.white


def test_difference_noise_ignores_what_is_smooth():
    time = np.arange(N) / 20.0
    signal = 300.0 * np.sin(2 * np.pi * 0.1 * time) + 1.5 * np.random.default_rng(2).standard_normal(N)
    assert difference_noise(signal) == pytest.approx(1.5, rel=0.03)


@pytest.mark.parametrize(("colour", "memory"), [(1.0, 0.9), (0.4, 0.7), (0.0, 0.0)])
def test_coloured_is_the_product_with_the_correlation_matrix(colour, memory):
    n = 40
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    matrix = np.where(apart == 0, 1.0, colour * memory**apart)
    sensitivity = np.random.default_rng(4).standard_normal((n, 3))
    assert coloured(sensitivity, Noise(1.0, 1.0, colour, memory, 0.5)) == pytest.approx(matrix @ sensitivity)

"""Signal-to-noise ratios against ones that are known."""

import numpy as np
import pytest

from hil.validation.strangers.car import Cause, Hidden, Noise, Tolerated
from hil.validation.strangers.snr import WHEELS, Visibility, Whitener, difference

N, WHITE = 400, 2.0


class _Zero:
    """A car that stands still; a sensor of pressure whose zero is hidden, and that of another wheel."""

    name = "zero"

    def __init__(self, tolerated: float = 0.0) -> None:
        self._tolerated = tolerated
        self.causes = {"offset": Cause("offset", "Pa", 0.01, 100.0, frozenset())}

    def stated(self, rng):
        return {}

    def drive(self, seed, hidden=None, noisy=True, off=None):
        by = sum(one for one in (hidden and hidden.size, off and off.deviation) if one)
        still = {name: np.zeros(N) for name in WHEELS}
        return [{"t_s": 0.01 * np.arange(N), **still, "pressure_fl_pa": np.full(N, by)}]

    def noise(self, seed):
        return Noise({"pressure_fl_pa": WHITE})

    def tolerated(self, stated):
        return [Tolerated("offset", self._tolerated)] if self._tolerated else [Tolerated("nothing", 0.0)]


def test_a_zero_in_white_noise_shows_by_the_root_of_its_samples() -> None:
    assert Visibility(_Zero(), 0, {}).snr(Hidden("offset", 0.5)) == pytest.approx(0.5 / WHITE * N**0.5)


def test_beside_a_tolerance_it_shows_no_more_than_its_deviations() -> None:
    """q = s's - (s'h)^2 / (h'h + 1) with h = s sd / size."""
    alone, sd = 0.5 / WHITE * N**0.5, 0.05
    own = sd / WHITE * N**0.5
    expected = alone / (own**2 + 1.0) ** 0.5
    found = Visibility(_Zero(sd), 0, {}).snr(Hidden("offset", 0.5))
    assert found == pytest.approx(expected)
    assert found < 0.5 / sd


def test_the_size_for_a_ratio_is_found() -> None:
    car = _Zero()
    hidden, snr = Visibility(car, 0, {}).sized(car.causes["offset"], 15.0)
    assert snr == pytest.approx(15.0, rel=0.02)
    assert hidden.size == pytest.approx(15.0 * WHITE / N**0.5, rel=0.02)


def test_a_range_that_ends_before_is_told_by_its_ratio() -> None:
    cause = Cause("offset", "Pa", 0.01, 0.5, frozenset())
    hidden, snr = Visibility(_Zero(), 0, {}).sized(cause, 15.0)
    assert (hidden.size, snr < 15.0) == (0.5, True)


def test_noise_as_stated_comes_out_white() -> None:
    """Gusts, a slope, coloured and white noise: innovations are independent, of standard deviation 1."""
    rng = np.random.default_rng(3)
    n, step, radius = 6000, 0.01, 0.32
    noise = Noise(
        {**dict.fromkeys(WHEELS, 0.03), "ax_mps2": 0.04, "pressure_fl_pa": 1e4},
        {"ax_mps2": (0.02, 5.0), "pressure_fl_pa": (5e3, 2.0)}, (0.03, 3.0), (0.02, 6.0),
    )  # fmt: skip

    def slow(size, tau):
        keep, state, found = np.exp(-step / tau), size * rng.standard_normal(), []
        for _ in range(n):
            found.append(state)
            state = keep * state + size * (1.0 - keep**2) ** 0.5 * rng.standard_normal()
        return np.array(found)

    gust, slope = slow(0.03, 3.0), slow(0.02, 6.0)
    speed = np.concatenate([[0.0], np.cumsum(gust - slope)[:-1] * step]) + 0.05 * rng.standard_normal()
    base = {"t_s": step * np.arange(n), **{name: np.full(n, 60.0) for name in WHEELS}}
    base |= {"ax_mps2": np.zeros(n), "pressure_fl_pa": np.zeros(n)}
    shown = {name: speed / radius + 0.03 * rng.standard_normal(n) for name in WHEELS}
    shown["ax_mps2"] = gust + slow(0.02, 5.0) + 0.04 * rng.standard_normal(n)
    shown["pressure_fl_pa"] = slow(5e3, 2.0) + 1e4 * rng.standard_normal(n)
    z = Whitener([base], noise)([{"t_s": base["t_s"], **shown}])
    told = z[z != 0.0]
    assert told.size == 6 * n
    assert np.mean(told**2) == pytest.approx(1.0, abs=0.03)
    wheels = z[: 6 * n].reshape(n, 6)[:, 0]
    assert abs(np.corrcoef(wheels[1:], wheels[:-1])[0, 1]) < 0.05


def test_motion_counts_until_either_car_is_slow() -> None:
    t = 0.01 * np.arange(10)
    fast = {"t_s": t, **{name: np.full(10, 50.0) for name in WHEELS}, "pressure_fl_pa": np.zeros(10)}
    slow = {**fast, **{name: np.r_[np.full(6, 50.0), np.zeros(4)] for name in WHEELS}, "pressure_fl_pa": np.ones(10)}
    (apart,) = difference([slow], [fast])
    assert np.isnan(apart[WHEELS[0]]).tolist() == [False] * 6 + [True] * 4
    assert apart["pressure_fl_pa"].tolist() == [1.0] * 10

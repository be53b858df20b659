"""Intervals of `explain` under coloured noise, by its own fit, noise estimate and interval."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.validation.perf.coverage import COEFFICIENTS, VALUE, Drives, Interval, coloured, drawn, row_of

DRAWS = 60
ASKED = (0.92, 0.98)
CHANCE = 0.005
"""Of each side of each check, were the coverage what is asked."""


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_95_percent_intervals_hold_the_truth_in_coloured_noise() -> None:
    """Least squares on the same drives shows that the noise is what it is said to be, and that this can fail."""
    drives = Drives()
    for coefficient in COEFFICIENTS:
        found = drawn(drives, coefficient, DRAWS)
        ours, others = zip(*found, strict=True)
        hits, by_others = (sum(one.holds for one in side) for side in (ours, others))
        assert binom.cdf(hits, DRAWS, ASKED[0]) > CHANCE, f"AR(1) {coefficient}: {hits} of {DRAWS}"
        assert binom.sf(hits - 1, DRAWS, ASKED[1]) > CHANCE, f"AR(1) {coefficient}: {hits} of {DRAWS}"
        squares = float(np.sum([one.error**2 for one in ours]))
        assert CHANCE < chi2.cdf(squares, DRAWS) < 1.0 - CHANCE, f"AR(1) {coefficient}: {squares / DRAWS}"
        if coefficient == 0.0:
            assert binom.cdf(by_others, DRAWS, ASKED[0]) > CHANCE
        if coefficient == 0.9:
            assert by_others / DRAWS < 0.5


@pytest.mark.slow
def test_without_the_noise_model_intervals_are_too_narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    start = Fitter.start
    monkeypatch.setattr(Fitter, "start", lambda fitter: start(fitter, enabled=False))
    found = drawn(Drives(), 0.9, 20)
    assert binom.cdf(sum(ours.holds for ours, _ in found), 20, ASKED[0]) < 1e-6


def test_the_noise_has_the_coefficient_and_the_variance_it_is_told() -> None:
    for coefficient in COEFFICIENTS:
        noise = coloured(np.random.default_rng(1), coefficient, (40000, 2))
        assert noise.std() == pytest.approx(1.0, abs=0.03)
        assert np.mean(noise[1:] * noise[:-1]) == pytest.approx(coefficient, abs=0.03)


def test_a_row_counts_what_holds_the_truth() -> None:
    inside, outside = (Interval(VALUE + by, VALUE + by - 0.01, VALUE + by + 0.01) for by in (0.005, 0.02))
    row = row_of(0.9, [(inside, outside)] * 19 + [(outside, outside)])
    assert (row.ours, row.other) == (0.95, 0.0)
    assert row.ratio == pytest.approx(20.0)
    assert row.ours_95 is not None
    assert row.ours_95[0] < 0.95 < row.ours_95[1]

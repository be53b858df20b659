"""The joint region holds the truth as often as it says."""

import numpy as np
import pytest
from scipy.stats import binom

from hil.identify.coverage import LEVEL, coverage, with_noise


def test_noise_is_of_the_size_and_colour_it_says(clean):
    record = clean["printed"]
    for colour, memory in (("white", 0.0), ("first-order", 0.9)):
        error = with_noise(record, colour, 4).temperature_k - record.temperature_k
        assert error.std() == pytest.approx(0.4, rel=0.15)
        assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(memory, abs=0.06)


def test_seeds_differ_and_repeat(clean):
    first, again, other = (with_noise(clean["printed"], "white", seed).torque_nm for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.slow
@pytest.mark.long
def test_joint_region_holds_the_truth(brake):
    """Ten seeds for each of two heating forms and two noises; the bound is passed 999 times in 1000."""
    rows = list(coverage(brake, range(100, 110)))
    assert [(row.heating, row.noise) for row in rows] == [
        ("printed", "white"), ("printed", "first-order"), ("friction", "white"), ("friction", "first-order"),
    ]  # fmt: skip
    assert sum(row.inside for row in rows) >= binom.ppf(1e-3, 40, LEVEL)
    assert all(row.met for row in rows)
    assert sum(row.form_found for row in rows) == 40

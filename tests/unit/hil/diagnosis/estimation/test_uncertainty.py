"""Intervals: noise is not all that is unknown of a value."""

import pytest

from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.estimation.uncertainty import FORM_SD_SHARE, half_width

ALL = candidates(columns())


@pytest.mark.parametrize("candidate", ALL[::15], ids=lambda c: c.name)
def test_the_models_own_error_widens_what_noise_leaves(candidate):
    half = half_width(candidate, 0.0, 2.0)
    assert half == pytest.approx(1.96 * 2.0 * variance_inflation(candidate) ** 0.5)
    assert half >= 1.96 * 2.0


def test_no_data_tell_a_value_better_than_its_equation():
    candidate = ALL[0]
    assert half_width(candidate, -3.0, 1e-9) == pytest.approx(1.96 * 3.0 * FORM_SD_SHARE)
    assert half_width(candidate, 3.0, 0.1) > half_width(candidate, 0.0, 0.1)

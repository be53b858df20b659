"""A nonparametric term against the best listed cause."""

from typing import Any

import pytest

from hil.diagnosis.detection.nonparametric_search import is_preferred
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.terms import candidates, columns

BEFORE = 1000.0
CANDIDATES = {c.name: c for c in candidates(columns())}


def _gains(gain: float, share_of_range: float = 0.5) -> FittedHypothesis:
    nothing: Any = None
    wind = CANDIDATES["headwind.wind_mps@car"]
    term = Term(wind, share_of_range * wind.parameter.high)
    return FittedHypothesis(term, nothing, BEFORE - gain, -4.0, 1.0, nothing)


@pytest.mark.parametrize(("gain", "preferred"), [(164.0, True), (130.0, False)])
def test_a_term_needs_the_least_gain(gain: float, preferred: bool) -> None:
    assert is_preferred(_gains(gain), None, False, BEFORE, 136.0) is preferred


@pytest.mark.parametrize("significant", [True, False])
def test_given_a_significant_listed_cause_a_term_gains_as_much_more(significant: bool) -> None:
    """A force above 15.5 m/s gained 164, stamps of the motors, far from significant, 82: it was not named."""
    assert is_preferred(_gains(164.0), _gains(82.0), significant, BEFORE, 136.0) is not significant
    assert is_preferred(_gains(230.0), _gains(82.0), significant, BEFORE, 136.0)


@pytest.mark.parametrize("significant", [True, False])
@pytest.mark.parametrize("share_of_range", [0.5, 1.0])
def test_a_term_that_explains_less_is_not_preferred(significant: bool, share_of_range: float) -> None:
    assert not is_preferred(_gains(164.0), _gains(170.0, share_of_range), significant, BEFORE, 136.0)


def test_a_term_is_clearly_more_probable_even_than_an_insignificant_cause() -> None:
    assert not is_preferred(_gains(164.0), _gains(156.0), False, BEFORE, 136.0)


def test_a_listed_cause_at_its_bound_is_no_rival_to_one_that_explains_more() -> None:
    assert is_preferred(_gains(164.0), _gains(156.0, 1.0), True, BEFORE, 136.0)

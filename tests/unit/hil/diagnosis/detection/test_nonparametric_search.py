"""A law in no list against the best listed cause."""

from typing import Any

import pytest

from hil.diagnosis.detection.nonparametric_search import is_preferred
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.terms import candidates, columns

BEFORE = 1000.0
CANDIDATES = {c.name: c for c in candidates(columns())}


def _gains(gain: float, share_of_range: float = 0.5) -> FittedHypothesis:
    nothing: Any = None
    wind = CANDIDATES["headwind.wind_mps@car"]
    term = Term(wind, share_of_range * wind.parameter.high)
    return FittedHypothesis(term, nothing, BEFORE - gain, -4.0, 1.0, nothing)


@pytest.mark.parametrize(("gain", "told"), [(164.0, True), (130.0, False)])
def test_a_law_explains_what_is_asked(gain: float, told: bool) -> None:
    assert is_preferred(_gains(gain), None, False, BEFORE, 136.0) is told


@pytest.mark.parametrize("clear", [True, False])
def test_beside_a_listed_cause_beyond_doubt_a_law_explains_as_much_more(clear: bool) -> None:
    """A force above 15.5 m/s gained 164, stamps of the motors, far from beyond doubt, 82: it was not told."""
    assert is_preferred(_gains(164.0), _gains(82.0), clear, BEFORE, 136.0) is not clear
    assert is_preferred(_gains(230.0), _gains(82.0), clear, BEFORE, 136.0)


@pytest.mark.parametrize("clear", [True, False])
@pytest.mark.parametrize("share_of_range", [0.5, 1.0])
def test_a_law_that_explains_less_is_behind(clear: bool, share_of_range: float) -> None:
    assert not is_preferred(_gains(164.0), _gains(170.0, share_of_range), clear, BEFORE, 136.0)


def test_a_law_is_clearly_likelier_even_than_a_cause_in_doubt() -> None:
    assert not is_preferred(_gains(164.0), _gains(156.0), False, BEFORE, 136.0)


def test_a_listed_cause_at_its_end_is_no_rival_to_one_that_explains_more() -> None:
    assert is_preferred(_gains(164.0), _gains(156.0, 1.0), True, BEFORE, 136.0)

"""Fitted hypotheses: what is at a bound, and how far one is behind another."""

from typing import Any

import numpy as np
import pytest

from hil.diagnosis.detection.profile_fit import (
    FittedHypothesis,
    at_bound,
    delta_chi2,
    delta_criterion,
    rival_hypotheses,
)
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.terms import candidates, columns

CANDIDATES = {c.name: c for c in candidates(columns())}


@pytest.mark.parametrize(("share", "bounded"), [(1.0, True), (0.999, False), (0.0, False)])
def test_the_largest_allowed_value_is_at_a_bound(share: float, bounded: bool) -> None:
    drag = CANDIDATES["headwind.drag_gain@car"]
    assert at_bound(Term(drag, share * drag.parameter.high)) is bounded


def _fitted(cost: float, occam: float, error: float, name: str = "mass_offset@car") -> FittedHypothesis:
    nothing: Any = None
    return FittedHypothesis(Term(CANDIDATES[name], 100.0), nothing, cost, occam, 1.0, nothing, discrepancy_factor=error)


@pytest.mark.parametrize(("error", "divisor"), [(np.inf, 1.0), (1.0, 1.0), (4.0, 4.0)])
def test_what_divides_gains_divides_their_difference(error: float, divisor: float) -> None:
    """A mass was 85 behind its motors, in lateral channels alone, in a car of another structure."""
    best, other = _fitted(-300.0, -4.0, error), _fitted(-260.0, -3.0, 9.0)
    assert delta_chi2(other, best) == pytest.approx(40.0 / divisor)
    assert delta_criterion(other, best) == pytest.approx(38.0 / divisor)
    assert delta_chi2(best, best) == delta_criterion(best, best) == 0.0


def test_what_is_named_as_another_cause_is_no_rival() -> None:
    """Ground speed 2 % off and a drag of one wheel: both were named, and could not be isolated from each other."""
    names = ["speed_scale@car", "residual_drag@rr", "residual_drag@rear", "mass_offset@car"]
    listed = [_fitted(10.0 * k, 0.0, 1.0, name) for k, name in enumerate(names)]
    left = rival_hypotheses(listed, {"speed_scale", "residual_drag"})
    assert [c.term.candidate.name for c in left] == ["speed_scale@car", "mass_offset@car"]


def test_other_locations_of_a_cause_stay_rivals() -> None:
    listed = [_fitted(10.0 * k, 0.0, 1.0, name) for k, name in enumerate(["residual_drag@rr", "residual_drag@rear"])]
    assert rival_hypotheses(listed, {"residual_drag"}) == listed

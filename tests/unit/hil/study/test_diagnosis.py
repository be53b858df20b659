"""What a cause leaves: the form of its equation before it is another cause."""

import pytest

from hil.study.candidates import candidates, columns
from hil.study.diagnosis import FORM, FORM_THERE, left_over
from hil.study.fit import Term

CANDIDATES = {c.name: c for c in candidates(columns())}
WATER = (Term(CANDIDATES["water@car"], 0.3),)


def test_pads_leave_more_at_the_pads_than_elsewhere():
    at_the_pads = left_over(1000.0, WATER, CANDIDATES["mu_speed.slope_s_m@car"])
    elsewhere = left_over(1000.0, WATER, CANDIDATES["mass_offset@car"])
    assert at_the_pads == pytest.approx(1000.0 * FORM_THERE**2)
    assert elsewhere == pytest.approx(1000.0 * FORM**2)
    assert at_the_pads > elsewhere


def test_no_cause_leaves_nothing():
    assert left_over(0.0, (), CANDIDATES["mu_speed.slope_s_m@car"]) == 0.0

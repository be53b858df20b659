"""Contenders for a cause: what is at the end of its range."""

import pytest

from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Term
from hil.study.search.contest import at_its_end

CANDIDATES = {c.name: c for c in candidates(columns())}


@pytest.mark.parametrize(("share", "ended"), [(1.0, True), (0.999, False), (0.0, False)])
def test_a_value_as_far_off_as_it_may_be_is_at_its_end(share: float, ended: bool) -> None:
    drag = CANDIDATES["headwind.drag_gain@car"]
    assert at_its_end(Term(drag, share * drag.parameter.high)) is ended

"""Contenders for a cause: what is at the end of its range."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Model, Term
from hil.study.search.contest import Contender, at_its_end

CANDIDATES = {c.name: c for c in candidates(columns())}
NO_NOISE: Any = SimpleNamespace()
NOTHING = Model(np.zeros(0), (), {}, 0.0, np.zeros((0, 0)))


@pytest.mark.parametrize(("share", "ended"), [(1.0, True), (0.999, False), (0.0, False)])
def test_a_value_as_far_off_as_it_may_be_is_at_its_end(share: float, ended: bool) -> None:
    drag = CANDIDATES["headwind.drag_gain@car"]
    term = Term(drag, share * drag.parameter.high)
    assert at_its_end(Contender(term, NOTHING, 0.0, 0.0, 1.0, NO_NOISE)) is ended

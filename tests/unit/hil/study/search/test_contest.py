"""Contenders for a cause: what is at the end of its range, and which leaders are worth a fit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Model, Term
from hil.study.fitting.own_error import variance_of
from hil.study.likelihood.noise import Noise
from hil.study.search.contest import Contender, at_its_end
from hil.study.search.diagnose import _worth_a_fit
from hil.study.search.left_over import LeftOver
from hil.study.search.screen import Score

CANDIDATES = {c.name: c for c in candidates(columns())}
NO_NOISE: Any = SimpleNamespace()
NOTHING = Model(np.zeros(0), (), {}, 0.0, np.zeros((0, 0)))


@pytest.mark.parametrize(("share", "ended"), [(1.0, True), (0.999, False), (0.0, False)])
def test_a_value_as_far_off_as_it_may_be_is_at_its_end(share: float, ended: bool) -> None:
    drag = CANDIDATES["headwind.drag_gain@car"]
    term = Term(drag, share * drag.parameter.high)
    assert at_its_end(Contender(term, NOTHING, 0.0, 0.0, 1.0, NO_NOISE)) is ended


def _score(name: str, gain: float, evidence: float) -> Score:
    candidate = CANDIDATES[name]
    return Score(candidate, 0.0, gain, evidence, 9.0, 9.0, 1.0, gain * variance_of(candidate))


def test_what_gains_too_little_is_fitted_only_where_it_is_ahead_of_what_gains_enough() -> None:
    noise: Noise = NO_NOISE
    nothing_before = LeftOver(0.0, SimpleNamespace(frame=None), NOTHING, noise, {})  # type: ignore[arg-type]
    doubtful, clear = _score("mu_road@car", 5.0, 30.0), _score("mass_offset@car", 12.0, 4.0)
    poor, next_to_it = _score("road_grade@car", 3.0, 1.0), _score("imu_bias.ax_mps2@car", 9.0, 3.0)
    assert _worth_a_fit([doubtful, clear, next_to_it, poor], nothing_before, 8.0) == [doubtful, clear, next_to_it]

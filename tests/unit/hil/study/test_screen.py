"""The race: estimates, bounds and thresholds of the linear screen."""

import numpy as np
import pytest

from hil.study.candidates import candidates, columns
from hil.study.linear import project, solve
from hil.study.screen import inflation, score, threshold

CANDIDATES = {c.name: c for c in candidates(columns())}


def test_a_score_finds_the_value_that_made_the_residual() -> None:
    candidate = CANDIDATES["mass_offset@car"]
    q, true = 1.0, 120.0
    found = score(candidate, q * true, q)
    assert found.value == pytest.approx(true, rel=1e-3)
    assert found.gain == pytest.approx(q * true**2, rel=0.3)


def test_a_value_of_the_forbidden_sign_explains_nothing() -> None:
    found = score(CANDIDATES["residual_drag@fl"], -50.0, 10.0)
    assert found.value == 0.0
    assert found.gain == 0.0


def test_what_leaves_no_trace_cannot_score() -> None:
    assert score(CANDIDATES["mass_offset@car"], 1.0, 0.0).reach == 0.0


def test_more_looks_ask_for_more() -> None:
    assert threshold(1, 0.05) == pytest.approx(3.841, abs=1e-3)
    assert threshold(100, 0.003) > threshold(10, 0.003) > threshold(1, 0.003)


def test_the_models_own_error_raises_what_is_asked() -> None:
    quiet = [score(c, 0.3, 1e4) for c in CANDIDATES.values()]
    loud = [score(c, 0.05 * c.parameter.typical * 1e6, 1e6) for c in CANDIDATES.values()]
    assert inflation(quiet) == 2.0
    assert inflation([]) == 2.0
    assert inflation(loud) >= 2.0


def test_a_nuisance_takes_only_what_its_tolerance_allows() -> None:
    """Column equal to the nuisance's: the share beyond the tolerance is left to the effect."""
    n, size = 1.0e4, 5.0  # five standard deviations off
    total = np.array([[n * size**2, n * size, n * size], [n * size, n, n], [n * size, n, n]])
    left = project(total, 1, (), np.zeros(1))
    assert left.b[0] ** 2 / left.q[0, 0] == pytest.approx(size**2, rel=1e-3)


def test_solve_gives_back_what_was_put_in() -> None:
    rng = np.random.default_rng(3)
    columns_, true = rng.standard_normal((500, 3)), np.array([0.5, -0.2, 2.0])
    joined = np.column_stack((columns_ @ true, columns_))
    change, _ = solve(joined.T @ joined * 1e4, 2, [0], np.zeros(2))
    assert change == pytest.approx(true, rel=1e-3)

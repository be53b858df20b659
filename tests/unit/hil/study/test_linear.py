"""The linearised problem: nuisances within their tolerance take their part, and no more."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.study.linear import project

NUISANCES, COLUMNS = 3, 2


def _products(seed: int) -> np.ndarray:
    """Products of [residual, nuisances, columns] over 200 samples."""
    rows = np.random.default_rng(seed).standard_normal((200, 1 + NUISANCES + COLUMNS))
    return rows.T @ rows


@given(seed=st.integers(0, 10_000), side=st.sampled_from((-1.0, 1.0)))
def test_a_nuisance_that_is_held_explains_nothing_more(seed, side):
    total = _products(seed)
    z = np.array([0.4, side * 3.0, -0.2])
    without = np.delete(np.delete(total, 2, axis=0), 2, axis=1)
    held, removed = project(total, NUISANCES, z=z, held=[1]), project(without, NUISANCES - 1, z=np.delete(z, 1))
    assert held.b == pytest.approx(removed.b, rel=1e-6, abs=1e-6)
    assert held.q == pytest.approx(removed.q, rel=1e-6, abs=1e-6)


@given(seed=st.integers(0, 10_000))
def test_nuisances_take_their_part_by_least_squares_with_their_prior(seed):
    total, z = _products(seed), np.array([0.4, 1.0, -0.2])
    found = project(total, NUISANCES, z=z)
    own = slice(1, 1 + NUISANCES)
    a = total[own, own] + np.eye(NUISANCES)
    moved = np.linalg.solve(a, total[own, 0] - z)
    expected = total[1 + NUISANCES :, 0] - total[1 + NUISANCES :, own] @ moved
    assert found.b == pytest.approx(expected, rel=1e-6, abs=1e-6)

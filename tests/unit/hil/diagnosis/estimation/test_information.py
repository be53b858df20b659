"""The linearised problem: nuisances are marginalised by their prior, steps stay within bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from hil.diagnosis.estimation.information import (
    InformationBlocks,
    marginalise,
    marginalise_from_onset,
    solve,
    solve_bounded,
)

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
    held, removed = marginalise(total, NUISANCES, z=z, held=[1]), marginalise(without, NUISANCES - 1, z=np.delete(z, 1))
    assert held.b == pytest.approx(removed.b, rel=1e-6, abs=1e-6)
    assert held.q == pytest.approx(removed.q, rel=1e-6, abs=1e-6)


@given(seed=st.integers(0, 10_000))
def test_nuisances_are_marginalised_by_least_squares_with_their_prior(seed):
    total, z = _products(seed), np.array([0.4, 1.0, -0.2])
    marginal = marginalise(total, NUISANCES, z=z)
    own = slice(1, 1 + NUISANCES)
    a = total[own, own] + np.eye(NUISANCES)
    moved = np.linalg.solve(a, total[own, 0] - z)
    expected = total[1 + NUISANCES :, 0] - total[1 + NUISANCES :, own] @ moved
    assert marginal.b == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(seed=st.integers(0, 10_000), begin=st.integers(0, 3))
def test_a_signature_from_an_onset_is_zero_before_it(seed, begin):
    rng, z = np.random.default_rng(seed), np.array([0.4, 3.0, -0.2])
    manoeuvres = rng.standard_normal((4, 50, 1 + NUISANCES + COLUMNS))
    matrix = np.stack([rows.T @ rows for rows in manoeuvres])
    summed = InformationBlocks(matrix, NUISANCES, 200, 0.0)
    b, q = marginalise_from_onset(summed, [[0], [1], [0, 1]], (), z, [1])
    cut = manoeuvres.copy()
    cut[:begin, :, 1 + NUISANCES :] = 0.0
    joined = cut.reshape(200, -1)
    expected = marginalise(joined.T @ joined, NUISANCES, z=z, held=[1])
    assert b[begin] == pytest.approx([*expected.b, expected.b.sum()], rel=1e-6, abs=1e-6)
    assert q[begin] == pytest.approx([*np.diag(expected.q), expected.q.sum()], rel=1e-6, abs=1e-6)
    together = marginalise(summed.since(begin), NUISANCES, z=z, held=[1])
    assert together.q == pytest.approx(expected.q, rel=1e-6, abs=1e-6)
    assert together.b == pytest.approx(expected.b, rel=1e-6, abs=1e-6)


@given(seed=st.integers(0, 10_000))
def test_a_bounded_step_is_optimal(seed):
    """Held against bounded least squares on the same problem, priors as rows of their own."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((40, NUISANCES + 2)) * 10.0 ** rng.uniform(-1.0, 1.0, NUISANCES + 2)
    joined = np.column_stack((rng.standard_normal(40) * 5.0, columns))
    z = rng.uniform(-1.0, 1.0, NUISANCES)
    low, high = -rng.uniform(0.0, 2.0, NUISANCES + 2), rng.uniform(1e-3, 2.0, NUISANCES + 2)
    change, _, decrease = solve_bounded(joined.T @ joined, NUISANCES, range(2), z, low, high)
    prior = np.eye(NUISANCES, NUISANCES + 2)
    rows, right = np.vstack((columns, prior)), np.concatenate((joined[:, 0], -z))
    best = lsq_linear(rows, right, (low, high), tol=1e-12, method="bvls")
    assert ((low - 1e-9 <= change) & (change <= high + 1e-9)).all()
    left = float(np.sum((rows @ change - right) ** 2))
    assert left == pytest.approx(2.0 * best.cost, rel=1e-6)
    assert decrease == pytest.approx(float(right @ right) - left, rel=1e-6, abs=1e-6)


def test_a_step_with_far_bounds_is_the_step_of_solve():
    rng = np.random.default_rng(5)
    joined = rng.standard_normal((50, 1 + NUISANCES + 1))
    total, z, far = joined.T @ joined, rng.standard_normal(NUISANCES), np.full(NUISANCES + 1, 1e3)
    change, covariance, _ = solve_bounded(total, NUISANCES, [0], z, -far, far)
    plain, other = solve(total, NUISANCES, [0], z)
    assert change == pytest.approx(plain, rel=1e-9)
    assert covariance == pytest.approx(other, rel=1e-9)

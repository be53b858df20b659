"""Functions that carry a linear part over a step, against the exponential of a larger matrix."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from plant.phi import phi_1, phi_2, phi_of_pair


def both(matrix):
    """phi_1 and phi_2 (Al-Mohy and Higham 2011, SIAM J. Sci. Comput. 33, 488, theorem 2.1)."""
    n = len(matrix)
    larger = np.zeros((3 * n, 3 * n))
    larger[:n, :n] = matrix
    larger[:n, n : 2 * n] = larger[n : 2 * n, 2 * n :] = np.eye(n)
    found = expm(larger)
    return found[:n, n : 2 * n], found[:n, 2 * n :]


@given(z=st.floats(0.0, 20.0))
def test_of_a_decay(z):
    first, second = both(np.array([[-z]]))
    one = phi_1(z, float(np.exp(-z)))
    assert one == pytest.approx(first[0, 0], rel=1e-9)
    assert phi_2(z, one) == pytest.approx(second[0, 0], rel=1e-6)


@given(decay=st.floats(0.0, 4.0), other=st.floats(0.0, 4.0), swing=st.floats(0.0, 4.0), skew=st.floats(0.05, 20.0))
def test_of_a_pair_that_swings_or_decays(decay, other, swing, skew):
    matrix = np.array([[-decay, swing * skew], [-swing / skew, -other]])
    one, one_m, two, two_m = phi_of_pair(float(np.trace(matrix)), decay * other + swing * swing)
    for found, exact in zip(
        (one * np.eye(2) + one_m * matrix, two * np.eye(2) + two_m * matrix), both(matrix), strict=True
    ):
        assert found == pytest.approx(exact, abs=1e-9 * (1.0 + np.abs(matrix).max()))


def test_of_a_pair_that_is_all_but_gone():
    """A stiff wheel near standstill: nothing grows."""
    matrix = np.array([[-30.0, 1.0], [-1.0, -0.1]])
    one, one_m, _, _ = phi_of_pair(float(np.trace(matrix)), float(np.linalg.det(matrix)))
    assert one * np.eye(2) + one_m * matrix == pytest.approx(both(matrix)[0], rel=1e-5, abs=1e-6)

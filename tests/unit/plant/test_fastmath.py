"""Our branch-free functions against the library, uncompiled (the compiled ones come from the same source)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant import fastmath


@given(st.floats(-1e6, 1e6))
def test_atan(x):
    assert fastmath._atan(x) == pytest.approx(math.atan(x), abs=2e-15, rel=4e-15)


@pytest.mark.parametrize("x", [0.0, 0.41421356, 0.4142136, 1.0, 2.41421356, 2.4142136, 1e300, -1e300])
def test_atan_at_its_seams(x):
    assert fastmath._atan(x) == pytest.approx(math.atan(x), abs=2e-15)


@given(st.floats(-12.0, 12.0))
def test_sin(x):
    assert fastmath._sin(x) == pytest.approx(math.sin(x), abs=4e-15)


@given(st.floats(-12.0, 12.0))
def test_cos(x):
    assert fastmath._cos(x) == pytest.approx(math.cos(x), abs=4e-15)


@given(st.floats(-1.0, 1.0))
def test_exp(x):
    assert fastmath._exp(x) == pytest.approx(math.exp(x), rel=1e-14)


@given(st.floats(-5.0, 5.0))
def test_exp_far(x):
    assert fastmath._exp(x) == pytest.approx(math.exp(x), rel=2e-9)

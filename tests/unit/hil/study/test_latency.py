"""Latencies on arrays: what is seen later is what was there before."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.study.latency import later


@settings(deadline=None)  # the first call compiles
@given(rows=st.floats(-5.0, 5.0), channels=st.integers(1, 4))
def test_all_channels_so_many_rows_later_are_straight_lines_between_rows(rows, channels):
    values = np.random.default_rng(1).standard_normal((30, channels))
    at = np.arange(30.0)
    expected = np.column_stack([np.interp(at - rows, at, column) for column in values.T])
    assert later(values, rows) == pytest.approx(expected)


def test_each_value_has_a_latency_of_its_own():
    values = np.arange(20.0).reshape(10, 2)
    rows = np.zeros((10, 2))
    rows[4, 1], rows[7, 0] = 1.5, 0.25
    expected = values.copy()
    expected[4, 1] -= 2.0 * 1.5
    expected[7, 0] -= 2.0 * 0.25
    assert later(values, rows) == pytest.approx(expected)


def test_channels_of_a_wider_table_are_shifted_too():
    table = np.random.default_rng(2).standard_normal((12, 6))
    assert later(table[:, 2:4], 1.0)[1:] == pytest.approx(table[:-1, 2:4])

"""Latencies on arrays: what is seen later is what was there before."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.diagnosis.data.grid import at_samples
from hil.diagnosis.simulation.measurement_model import delayed, toothed, without_latency
from plant.injection.theta import THETA
from plant.vectors import INPUT


@given(rows=st.floats(-5.0, 5.0), channels=st.integers(1, 4))
def test_what_has_corners_is_shifted_on_straight_lines(rows, channels):
    values = np.random.default_rng(1).standard_normal((30, channels))
    at = np.arange(30.0)
    expected = np.column_stack([np.interp(at - rows, at, column) for column in values.T])
    assert delayed(values, np.full(30, rows), straight=True) == pytest.approx(expected)


@given(rows=st.floats(-3.0, 3.0), a=st.floats(-2.0, 2.0), b=st.floats(-2.0, 2.0))
def test_a_parabola_is_shifted_exactly(rows, a, b):
    at = np.arange(30.0)
    inside = slice(5, 25)
    shifted = delayed((a * at**2 + b * at)[:, None], np.full(30, rows))[inside, 0]
    assert shifted == pytest.approx((a * (at - rows) ** 2 + b * (at - rows))[inside], abs=1e-9)


def test_a_wheel_that_swings_at_25_hz_keeps_its_swing_between_samples():
    at = np.arange(60.0)
    places = np.arange(10.0, 50.0) + 0.3
    swing = 2.0 * np.pi * 25.0 * 0.01
    between = at_samples(np.sin(swing * at), places)
    true = np.sin(swing * places)
    straight = np.interp(places, at, np.sin(swing * at))
    assert np.abs(between - true).max() < 0.5 * np.abs(straight - true).max()


def test_places_outside_are_the_ends():
    assert at_samples(np.array([3.0, 5.0, 4.0]), np.array([-2.0, 0.0, 2.0, 9.0])) == pytest.approx([3.0, 3.0, 4.0, 4.0])


def test_the_steering_wheel_may_act_later_than_it_is_logged():
    inputs = INPUT.zeros() + np.zeros((40, 1))
    inputs[:, INPUT.at.steering_wheel_rad] = np.arange(40.0)
    moved = without_latency(inputs, (0.0, 0.0, 0.0, 0.0, 0.0, 0.005, 0.0, 0.0), THETA.neutral())
    assert moved[5:35, INPUT.at.steering_wheel_rad] == pytest.approx(np.arange(5.0, 35.0) - 0.5)


def test_channels_of_a_wider_table_are_shifted_too():
    table = np.random.default_rng(2).standard_normal((12, 6))
    assert delayed(table[:, 2:4], np.ones(12))[1:] == pytest.approx(table[:-1, 2:4])


def test_the_lag_of_a_toothed_wheel_is_that_of_the_speed_when_it_was_sampled():
    """Stamps 20 ms late of a wheel that slows down: measured first, stamped then, in one shift or in two."""
    omega, none, late = np.linspace(30.0, 4.0, 105)[:, None], np.zeros(105), np.full(105, 2.0)
    at_once, measured = np.empty_like(omega), np.empty_like(omega)
    toothed(omega, 0.0, 6.5, 1.0, late, at_once)
    toothed(omega, 0.0, 6.5, 1.0, none, measured)
    assert at_once[5:] == pytest.approx(delayed(measured, late)[5:], abs=1e-9)

"""The tyre's symmetries and limits; its curves are held against another code in hil.validation.verify."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

from plant.model import pack
from plant.tyre import combined, magic, partly_sliding, sliding_relaxation
from plant.vectors import P

slips = st.floats(-1.0, 1.0)
angles = st.floats(-0.5, 0.5)
loads = st.floats(500.0, 8000.0)


@pytest.fixture(scope="module")
def p(paper_car):
    return pack(paper_car)


@given(slips, angles, loads)
def test_right_mirrors_left(p, slip, angle, load):
    left_x, left_y = combined(slip, angle, load, 1.0, 1.0, p)
    right_x, right_y = combined(slip, -angle, load, 1.0, -1.0, p)
    assert right_x == pytest.approx(left_x, abs=1e-9)
    assert right_y == pytest.approx(-left_y, abs=1e-9)


@given(slips, angles, loads, st.floats(0.05, 1.0))
def test_force_stays_inside_the_friction(p, slip, angle, load, friction):
    force, cross = combined(slip, angle, load, friction, 1.0, p)
    assert math.isfinite(force)
    assert math.isfinite(cross)
    assert math.hypot(force, cross) <= 1.9 * friction * load  # the corner of peak 1.29 and 1.12 at the lowest load


def test_signs(p):
    force, cross = combined(0.05, 0.05, 4000.0, 1.0, 1.0, p)
    assert force > 0.0  # a wheel turning faster than the road drives
    assert cross < 0.0  # moving left, it is pushed right


def test_free_rolling_gives_nothing(p):
    assert combined(0.0, 0.0, 4000.0, 1.0, 1.0, p) == (0.0, 0.0)


def test_road_friction_scales_the_peak_not_the_stiffness(p):
    small = 1e-4
    dry, wet = (combined(small, 0.0, 4000.0, mu, 1.0, p)[0] for mu in (1.0, 0.5))
    assert wet == pytest.approx(dry, rel=1e-3)
    dry, wet = (max(combined(k / 500, 0.0, 4000.0, mu, 1.0, p)[0] for k in range(500)) for mu in (1.0, 0.5))
    assert wet == pytest.approx(0.5 * dry, rel=1e-3)


def test_curvature_and_shape_of_combined_slip_are_not_swapped(paper_car, p):
    """Published copies swap r_ex1 and r_cx1: with ours, half of the longitudinal force is left at about 12 deg."""
    alone = combined(-0.1, 0.0, 4000.0, 1.0, 1.0, p)[0]
    left = combined(-0.1, math.radians(12.0), 4000.0, 1.0, 1.0, p)[0] / alone
    tyre = paper_car.tyre
    swapped = pack(replace(paper_car, tyre=replace(tyre, rex1=tyre.rcx1, rcx1=tyre.rex1)))
    wrong = combined(-0.1, math.radians(12.0), 4000.0, 1.0, 1.0, swapped)[0] / alone
    assert p[P.tyre_rcx1] == 1.2568
    assert p[P.tyre_rex1] == 0.65225
    assert 0.4 < left < 0.6
    assert wrong > 0.7


def test_relaxation_shortens_with_sliding(plain):
    length = plain(sliding_relaxation)
    assert length(0.25, 0.0, 0.16, 0.04) == 0.25
    assert length(0.25, -0.08, 0.16, 0.04) == pytest.approx(0.125)
    assert length(0.25, 1.0, 0.16, 0.04) == 0.04


def force_over_peak(x: float, c: float, e: float, d: float, share: float) -> float:
    """Magic Formula of peak ``d`` and slip stiffness 1 at slip x, with partial sliding."""
    return magic(1.0 / (c * d), c, d, e, partly_sliding(x, x, share))


@pytest.mark.parametrize("form", [
    lambda x: 1.0 - (1.0 - x / 3.0) ** 3, lambda x: 1.0 - math.exp(-x), math.tanh,
], ids=["brush", "exponential", "tanh"])  # fmt: skip
def test_brush_exponential_and_tanh_lie_within_the_magic_formula_with_partial_sliding(form):
    """At a given slip stiffness and up to 0.8 of the peak; without partial sliding the first two are 2 and 3 % off."""
    xs = [0.05 * k for k in range(1, 24)]

    def residuals(z):
        return [force_over_peak(x, *z) - form(x) for x in xs]

    fitted = least_squares(residuals, (1.4, 0.0, 1.0, 0.3), bounds=((0.8, -2.0, 0.5, 0.0), (3.3, 1.0, 2.5, 1.5)))
    assert max(map(abs, fitted.fun)) < 1e-3
    assert (fitted.x[3] > 0.3) == (form is not math.tanh)


def test_no_partial_sliding_leaves_the_slip_as_it_is_to_the_last_bit():
    assert [partly_sliding(s, 22.0 * abs(s), 0.0) for s in (-0.3, -1e-9, 0.07)] == [-0.3, -1e-9, 0.07]

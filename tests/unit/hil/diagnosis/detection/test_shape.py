"""Shape parameters: how far one is moved for a finite difference."""

import pytest

from hil.diagnosis.detection.shape import _within
from plant.injection.theta import THETA

_BEGINS = THETA.effect("pad_temp_fade").parameter("start_k")


@pytest.mark.parametrize(
    ("at", "step", "moved"),
    [
        (480.0, 20.0, 20.0),
        (_BEGINS.high, 20.0, -20.0),
        (_BEGINS.high - 10.0, 20.0, -20.0),
        (_BEGINS.low + 10.0, 1e6, _BEGINS.high - _BEGINS.low - 10.0),
        (_BEGINS.high - 10.0, 1e6, -(_BEGINS.high - _BEGINS.low - 10.0)),
    ],
)
def test_a_shape_stays_within_its_bounds(at, step, moved):
    """One with a large deviation was moved by its whole range, beyond its bounds."""
    assert _within(at, step, _BEGINS) == pytest.approx(moved)

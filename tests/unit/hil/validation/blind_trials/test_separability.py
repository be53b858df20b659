"""How far apart causes are: the nearest of all others, and what the table says of a record."""

import tomllib

import numpy as np
import pytest

from hil.validation.blind_trials.separability import Signature, as_toml, nearest


def _signatures(bounds: tuple[float, float] = (-10.0, 10.0)) -> list[Signature]:
    """Of ratio 5, along x and 37 degrees from it, and one of ratio 1 across."""
    return [Signature("a", "car", (-10.0, 10.0), 5.0), Signature("b", "car", bounds, 5.0),
            Signature("c", "car", (-10.0, 10.0), 1.0)]  # fmt: skip


_SHOWN = np.array([[5.0, 0.0], [4.0, 3.0], [0.0, 1.0]])


@pytest.mark.parametrize(("size", "distance"), [(5.0, 3.0), (15.0, 9.0)])
def test_d_prime_is_what_the_nearest_leaves(size: float, distance: float) -> None:
    assert nearest(0, _signatures(), _SHOWN @ _SHOWN.T, size) == (pytest.approx(distance), "b@car")


def test_a_rival_goes_no_farther_than_its_bounds() -> None:
    assert nearest(0, _signatures((-1.0, 0.4)), _SHOWN @ _SHOWN.T, 5.0)[0] == pytest.approx(np.hypot(3.4, 1.2))
    assert nearest(0, _signatures((-1.0, 0.0)), _SHOWN @ _SHOWN.T, 5.0)[0] == pytest.approx(5.0)


def test_the_same_effect_elsewhere_is_no_rival() -> None:
    own, other = Signature("a", "fl", (-1.0, 1.0), 1.0), Signature("a", "fr", (-1.0, 1.0), 1.0)
    assert nearest(0, [own, other, Signature("b", "fl", (-1.0, 1.0), 1.0)], np.array(
        [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), 1.0) == (1.0, "b@fl")  # fmt: skip


def test_the_file_reads_back_and_says_how_it_was_made() -> None:
    text = as_toml({("a", "fl", "low"): {8.0: (2.0, "b@fl"), 15.0: (3.75, "b@car")}}, 7)
    assert tomllib.loads(text) == {"a": {"fl": {"low": {"at_8": [2.0, "b@fl"], "at_15": [3.8, "b@car"]}}}}
    assert "--apart FILE --seed 7" in text

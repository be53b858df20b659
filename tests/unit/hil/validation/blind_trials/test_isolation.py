"""Isolation: whose probability counts, and what a tie is worth."""

import pytest

from hil.validation.blind_trials.isolation import probabilities, share_of_first


def _entry(effect: str, probability: float) -> dict[str, object]:
    return {"effect": effect, "probability": probability}


def test_the_best_place_of_an_effect_counts() -> None:
    found = probabilities([_entry("pads", 0.5), _entry("pads", 0.2), _entry("mass", 0.3)])
    assert found == pytest.approx({"pads": 0.5, "mass": 0.3})


def test_several_causes_share_what_is_there() -> None:
    found = probabilities([_entry("pads", 1.0), _entry("mass", 0.6)])
    assert found == pytest.approx({"pads": 0.625, "mass": 0.375})


@pytest.mark.parametrize(
    ("chances", "share"),
    [
        ({"pads": 0.6, "mass": 0.4}, 1.0),
        ({"pads": 0.4, "mass": 0.6}, 0.0),
        ({"pads": 0.4, "mass": 0.4, "none": 0.2}, 0.5),
        ({"pads": 0.4, "none": 0.6}, 0.0),
        ({"pads": 0.3, "mass": 0.3 + 1e-15, "drag": 0.3}, 1.0 / 3.0),
        ({"none": 1.0}, 0.0),
        ({}, 0.0),
    ],
)
def test_a_tie_shares_the_first_rank(chances: dict[str, float], share: float) -> None:
    assert share_of_first(chances, "pads") == pytest.approx(share)

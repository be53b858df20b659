"""What the table of d' says of a record."""

from typing import Any

from hil.validation.blind_trials.separable import _table, separable
from hil.validation.reference_car.cases import SEPARABLE
from hil.validation.reference_car.noise import LEVELS


def _record(effect: str, wheel: str, size: float = 15.0, noise: str = "low") -> dict[str, Any]:
    return {"hidden": [{"effect": effect, "location": wheel}], "size": size, "noise": noise}


def test_a_drag_and_the_rolling_resistance_of_an_axle_are_one_but_a_grade_and_the_mass_stand_alone() -> None:
    for noise in LEVELS:
        assert not separable(_record("rolling_resistance", "front", noise=noise))
        assert not separable(_record("residual_drag", "front", noise=noise))
        assert separable(_record("road_grade", "car", noise=noise))
        assert separable(_record("mass_offset", "car", 8.0, noise))


def test_every_effect_of_the_family_was_measured_and_ratios_that_nothing_is_asked_of_were_not() -> None:
    assert {(e, w) for e, wheels in _table().items() for w in wheels} == {
        (k.name, w) for k in SEPARABLE for w in k.where
    }
    assert separable(_record("rolling_resistance", "front", 5.0))

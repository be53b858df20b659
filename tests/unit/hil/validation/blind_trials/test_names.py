"""Numbers of the reference car by the plant's name: every one that can be, and the oracle's candidates with them."""

from hil.diagnosis.estimation.terms import candidates, columns
from hil.validation.blind_trials.names import numbers
from hil.validation.reference_car.cases import SEPARABLE

PHASED = {"dtv_judder", "wheel_tooth_error"}  # an amplitude and a phase there, a sine and a cosine here


def test_the_plant_has_every_hidden_number_at_its_place_but_those_with_a_phase() -> None:
    known = {(c.effect.name, c.parameter.name, c.location) for c in candidates(columns())}
    strange = set()
    for kind in SEPARABLE:
        for place in kind.where:
            hidden = {"effect": kind.name, "parameters": {kind.parameter: {"value": kind.typical}}}
            (name,) = numbers(hidden)
            if (kind.name, name, place) not in known:
                strange.add(kind.name)
    assert strange == PHASED


def test_a_number_keeps_its_value() -> None:
    hidden = {"effect": "imu_filter", "parameters": {"lag_s": {"value": 0.02}}}
    assert numbers(hidden) == {"time_s": 0.02}


def test_spots_half_a_turn_on_are_the_same_spots() -> None:
    hidden = {"effect": "hot_spot", "location": "rear", "parameters": {"amplitude": {"value": -0.002, "unit": ""}}}
    assert numbers(hidden) == {"amplitude": 0.002}

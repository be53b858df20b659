"""Cars of other equations, tyres, hydraulics and loggers: nothing is named where nothing is hidden."""

import pytest

from hil.diagnosis.explain import explain
from hil.validation.strangers.car import Hidden
from hil.validation.strangers.cases import CARS, draw, write

SEED = 49
pytestmark = [pytest.mark.slow]


def answered(car, seed, hidden, folder):
    write(car, seed, hidden, folder)
    return explain([folder], folder / "vehicle.toml").json


@pytest.mark.parametrize(
    "index",
    [pytest.param(k, id=name, marks=[pytest.mark.long] * (name == "hydraulic_saloon")) for k, name in enumerate(CARS)],
)
def test_nothing_hidden_is_no_cause(index, tmp_path):
    case = draw("strangers", index, SEED)
    answer = answered(case.car, case.seed, None, tmp_path / "logs")
    assert answer["causes"] == []
    assert {one["channel"] for one in answer["goodness_of_fit"]} >= {"wheel_speed", "ax_mps2"}


def test_weak_front_pads_of_a_strangers_car_are_found(tmp_path):
    """A fifth weaker, in a car with dead times, stiff springs and old sensors."""
    car, hidden = CARS["dead_time"], Hidden("front_pads_weak", -0.2)
    answer = answered(car, 1, hidden, tmp_path / "logs")
    tied = answer["causes"][:1] + (answer["rivals"] if answer["verdict"] == "cannot_tell_apart" else [])
    assert any(car.causes[hidden.cause].accepts(one["effect"], one["location"]) for one in tied)

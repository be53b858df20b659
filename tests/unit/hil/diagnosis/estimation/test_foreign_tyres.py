"""Tyres of other families are within the nuisance parameters: no cause is made of the form of a curve."""

from dataclasses import replace

import pytest
import single_track
from threadpoolctl import threadpool_limits

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.result import Settings
from hil.diagnosis.detection.stepwise import StepwiseSelection
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.load import load_vehicle


def screened(tyre: str, without: str = "") -> tuple[float, str, float, float]:
    """Cost, best candidate, its gain and the detection threshold, given the nuisance parameters, ``without`` one."""
    logs = single_track.stops(tyre)
    car = load_vehicle(single_track.CAR).without_lateral_dynamics()
    car = replace(car, nuisances=tuple(one for one in car.nuisances if one.name != without))
    dataset = prepare(logs, single_track.CAR["rolling_radius_m"], car.unstated)
    with threadpool_limits(1, "blas"):
        state = StepwiseSelection(dataset, car, nominal(car), Settings(), lambda _: None).fit_nuisances()
    best = max(state.screening.scores, key=lambda one: one.gain)
    return state.model.cost, best.candidate.name, best.gain, state.threshold.gain


@pytest.mark.slow
@pytest.mark.parametrize("tyre", single_track.TYRES)
def test_nothing_is_found_in_a_car_with_other_tyres(tyre: str) -> None:
    _, name, gain, threshold = screened(tyre)
    assert gain < threshold, name


@pytest.mark.slow
def test_without_partial_sliding_an_exponential_tyre_passes_for_a_soft_one() -> None:
    cost = screened("exponential")[0]
    worse, name, gain, threshold = screened("exponential", "tyre_partial_sliding")
    assert worse > cost + 100.0
    assert name.startswith("slip_stiffness")
    assert gain > 2.0 * threshold

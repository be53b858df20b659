"""A cause is told only where its value is away from nothing."""

from dataclasses import replace

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refitted
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.significance import eliminate_backward, is_significant, local_inflation, with_gain
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


def _accepted(hidden: float) -> Diagnosis:
    """A diagnosis that has accepted a headwind, of which there is as much as hidden."""
    vehicle = load_vehicle(VEHICLE)
    case = prepare([log_as_driven(vehicle, 0.318)], 0.318)
    rig, base = Simulator(case, vehicle), nominal(vehicle)
    (wind,) = [one for one in candidates(columns()) if one.name == "headwind.wind_mps@car"]
    rng = np.random.default_rng(2)
    (drive,) = case.recordings
    for group, told in rig.run(wind.applied(base, hidden)).items():
        drive.measured[group][:] = told + DEVIATIONS.get(group, 0.02) * rng.standard_normal(told.shape)
    numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True)
    fitter = numbers.fitter
    bare, noise = numbers.fit(*fitter.start())
    begun = fitter.at(bare.z, (Term(wind, 0.5 * hidden),), noise)
    final = fitter.fit(begun, noise, 5)
    one = refitted(FittedHypothesis(final.terms[0], final, final.cost, 0.0, 1.0, noise), final, noise)
    return Diagnosis(
        case,
        vehicle,
        fitter,
        noise,
        noise,
        bare,
        bare,
        final,
        hypotheses=[[one]],
        number_of_tests=126,
        detection_threshold=20.0,
    )


def test_a_cause_that_is_there_stays():
    found = _accepted(12.0)
    final = found.final
    eliminate_backward(found, found.fitter, 20.0, lambda _: None)
    assert found.final is final
    assert found.remarks == []


@pytest.mark.parametrize("hidden", [0.0, 0.5])
def test_a_cause_that_may_be_nothing_goes_and_the_remarks_name_it(hidden):
    found, said = _accepted(hidden), []
    eliminate_backward(found, found.fitter, 20.0, said.append)
    assert found.final is found.base
    assert found.hypotheses == []
    assert found.remarks == said
    assert "headwind" in said[0]
    assert "deviations from nothing, asked 3.5" in said[0]


@pytest.mark.parametrize(("most_left", "inflation", "error"), [(2.0, 1.0, 1.0), (75.0, 1.0, 10.0), (75.0, 2.0, 5.0)])
def test_what_is_left_beside_a_cause_says_how_much_the_model_errs(most_left, inflation, error):
    """The largest of 85 looks at noise alone reaches 7.5 every second time."""
    found = _accepted(12.0)
    found.number_of_tests, found.inflation = 85, inflation
    assert local_inflation(most_left, found) == pytest.approx(error, rel=0.02)


def test_a_chosen_beginning_is_paid_in_the_odds_and_in_the_gain():
    ((one,),) = _accepted(12.0).hypotheses
    begun = replace(one, onset_penalty=13.0)
    assert criterion(begun) - criterion(one) == pytest.approx(13.0)
    always, later = (with_gain(c, one.cost + 100.0, 2.0) for c in (one, begun))
    assert always.gain - later.gain == pytest.approx(13.0)
    assert always.discrepancy_factor == 2.0


def test_a_cause_at_its_end_is_none_in_a_car_of_another_form():
    """Hubs as soft as they may be were told of a car with nothing hidden, whose tyres slip by another law."""
    found = _accepted(12.0)
    ((one,),) = found.hypotheses
    one = replace(one, gain=100.0)
    ended = replace(one, term=replace(one.term, value=one.term.candidate.parameter.high))
    bent = replace(one.model, z=np.full_like(one.model.z, 5.0))
    assert is_significant(ended, 20.0, found.fitter, 20.0)
    assert is_significant(replace(one, model=bent), 20.0, found.fitter, 20.0)
    assert not is_significant(replace(ended, model=bent), 20.0, found.fitter, 20.0)
    assert not is_significant(replace(one, gain=19.0), 20.0, found.fitter, 20.0)

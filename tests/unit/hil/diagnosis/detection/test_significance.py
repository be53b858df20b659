"""Significance: gains beyond noise and model discrepancy, values away from zero, and what accepted causes leave."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.nonparametric import NONPARAMETRIC_TERMS, basis_expansion
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refitted, unscored
from hil.diagnosis.detection.reference_fit import common_parts, since
from hil.diagnosis.detection.significance import (
    Elimination,
    FormErrorAllowance,
    eliminate_backward,
    is_significant,
    local_inflation,
    signature_overlap,
    with_gain,
)
from hil.diagnosis.detection.threshold import DetectionThreshold
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle
from plant.effects.effect import Effect

LEVEL_AND_STILL = {f"{key}_tolerance": 0.0 for key in ("road_grade", "wind_mps", "ax_zero_mps2")}
"""What else would share in a headwind in one log of 20 s."""
DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}
THRESHOLD = DetectionThreshold(126, 1e-3, 1.0)


@dataclass(frozen=True, eq=False)
class _Accepted:
    fitter: Fitter
    model: Model
    noise: Noise
    hypothesis: FittedHypothesis

    def eliminated(self, remarks: list[str]) -> Elimination:
        return eliminate_backward(
            self.fitter, self.model, self.noise, [[self.hypothesis]], THRESHOLD, 20.0, remarks.append
        )


def _accepted(hidden: float) -> _Accepted:
    """A model that has accepted a headwind, of which there is as much as hidden."""
    vehicle = load_vehicle(VEHICLE | LEVEL_AND_STILL)
    dataset = prepare([log_as_driven(vehicle, 0.318)], 0.318)
    simulator, base = Simulator(dataset, vehicle), nominal(vehicle)
    (wind,) = [one for one in candidates(columns()) if one.name == "headwind.wind_mps@car"]
    rng = np.random.default_rng(2)
    (recording,) = dataset.recordings
    for group, values in simulator.run(wind.applied(base, hidden)).items():
        recording.measured[group][:] = values + DEVIATIONS.get(group, 0.02) * rng.standard_normal(values.shape)
    nuisance_fit = NuisanceFit(simulator, SampleMasks.of(dataset), vehicle, base, relinearise=True)
    fitter = nuisance_fit.fitter
    bare, noise = nuisance_fit.fit(*fitter.start())
    start = fitter.at(bare.z, (Term(wind, 0.5 * hidden),), noise)
    model = fitter.fit(start, noise, 5)
    return _Accepted(fitter, model, noise, refitted(unscored(model, noise, 1.0), model, noise))


def test_a_cause_that_is_there_stays():
    accepted = _accepted(12.0)
    left = accepted.eliminated([])
    assert left.model is accepted.model
    assert left.remarks == ()


@pytest.mark.parametrize("hidden", [0.0, 0.5])
def test_a_cause_that_may_be_zero_goes_and_the_remarks_name_it(hidden):
    messages: list[str] = []
    left = _accepted(hidden).eliminated(messages)
    assert left.model.terms == ()
    assert left.hypotheses == ()
    assert list(left.remarks) == messages
    assert "headwind" in messages[0]
    assert "standard deviations from zero, 3.5 needed" in messages[0]


@pytest.mark.parametrize(("largest", "inflation", "factor"), [(2.0, 1.0, 1.0), (75.0, 1.0, 10.0), (75.0, 2.0, 5.0)])
def test_what_others_gain_given_a_cause_is_the_local_inflation(largest, inflation, factor):
    """The largest of 85 tests reaches 7.5 by noise every second time."""
    assert local_inflation(largest, DetectionThreshold(85, 1e-3, inflation)) == pytest.approx(factor, rel=0.02)


def test_a_chosen_onset_is_a_penalty_in_the_criterion_and_in_the_gain():
    one = _accepted(12.0).hypothesis
    later = replace(one, onset_penalty=13.0)
    assert criterion(later) - criterion(one) == pytest.approx(13.0)
    always, penalised = (with_gain(c, one.cost + 100.0, 2.0) for c in (one, later))
    assert always.gain - penalised.gain == pytest.approx(13.0)
    assert always.discrepancy_factor == 2.0


def test_a_cause_at_its_bound_is_not_significant_in_a_car_of_another_structure():
    """Hubs as soft as they may be were named in a car with nothing hidden, whose tyres follow another equation."""
    accepted = _accepted(12.0)
    one = replace(accepted.hypothesis, gain=100.0)
    bounded = replace(one, term=replace(one.term, value=one.term.candidate.parameter.high))
    far = replace(one.model, z=np.full_like(one.model.z, 5.0))
    assert is_significant(bounded, 20.0, accepted.fitter, 20.0)
    assert is_significant(replace(one, model=far), 20.0, accepted.fitter, 20.0)
    assert not is_significant(replace(bounded, model=far), 20.0, accepted.fitter, 20.0)
    assert not is_significant(replace(one, gain=19.0), 20.0, accepted.fitter, 20.0)


def test_signatures_in_the_same_places_overlap_wholly_and_elsewhere_not_at_all():
    one = np.array([4.0, 0.0, 1.0, 0.0])
    assert signature_overlap(one, 3.0 * one) == pytest.approx(1.0)
    assert signature_overlap(one, np.array([0.0, 2.0, 0.0, 5.0])) == 0.0
    assert signature_overlap(one, np.array([4.0, 0.0, 0.0, 0.0])) == pytest.approx(0.8)


def test_a_signature_that_is_nowhere_overlaps_with_none():
    assert signature_overlap(np.zeros(3), np.ones(3)) == 0.0


def test_no_error_of_the_form_gives_a_signature_more_and_the_worst_gives_it_all():
    """An error is a share of the cause in each place, however it varies within."""
    rng = np.random.default_rng(4)
    cause, other = rng.normal(size=(2, 6, 50))
    energies = [np.sum(values**2, axis=1) for values in (cause, other)]
    share, bound = 0.3, 0.3**2 * energies[0].sum() * signature_overlap(*energies)

    def taken(errors):
        sized = errors * share * (energies[0] / np.sum(errors**2, axis=1))[:, None] ** 0.5
        return float(np.sum(sized * other)) ** 2 / energies[1].sum()

    assert max(taken(rng.normal(size=cause.shape)) for _ in range(200)) < bound
    assert taken(other) == pytest.approx(bound)


def test_a_change_that_the_reference_shows_as_strongly_is_none():
    """Slip stiffness by speed in both of two drives: a change there must gain more than the curve does."""
    vehicle = load_vehicle(VEHICLE)
    log = log_as_driven(vehicle, 0.318)
    dataset = prepare([log, replace(log, name="another")], 0.318)
    (unknown,) = [one for one in NONPARAMETRIC_TERMS if one.name == "tyre.stiffness(speed)"]
    curve = basis_expansion(unknown, 5.0, 33.0)
    base, added = common_parts(nominal(vehicle), (), (), [curve])
    simulator, masks = Simulator(dataset, vehicle), SampleMasks.of(dataset)
    nuisances = (*vehicle.nuisances, *added)
    fit = NuisanceFit(simulator, masks, vehicle, since(base, 1), relinearise=False, nuisances=nuisances)
    fitter = fit.fitter
    none, noise = fitter.start()
    z = np.append(np.zeros(len(vehicle.nuisances)), np.full(len(added), 0.3))
    columns_of_curve = {
        name: values[:, -len(added) :].sum(axis=1, keepdims=True) for name, values in fitter.nuisance_jacobian.items()
    }
    (wind,) = [one for one in candidates(columns()) if one.name == "headwind.wind_mps@car"]

    def left(z: np.ndarray, effect: Effect) -> float:
        model = replace(none, z=z)
        return FormErrorAllowance(0.0, fitter, model, noise, {}).of_signature(effect, columns_of_curve)

    own = curve.functions[0].effect
    assert left(0.0 * z, own) == left(0.0 * z, wind.effect) == 0.0
    assert left(2.0 * z, own) == pytest.approx(4.0 * left(z, own))
    assert 0.0 < left(z, wind.effect) < left(z, own)
    fitter.base = base
    assert left(z, own) == 0.0

"""Hypotheses that act alike end alike, and one cause takes the place of two that imitate it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refit_from_best, refitted, unscored
from hil.diagnosis.detection.stepwise import try_single_cause
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car

DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


class _Driven:
    """A recording with something hidden, and the nuisance parameters fitted without a cause."""

    def __init__(self, hidden: dict[str, float]) -> None:
        vehicle = paper_car()
        dataset = prepare([log_as_driven(vehicle, 0.308)], 0.308)
        masks = SampleMasks.of(dataset)
        simulator, base, rng = Simulator(dataset, vehicle), nominal(vehicle), np.random.default_rng(3)
        self.candidates = CandidateSet(simulator, masks, ())
        changed = base
        for name, value in hidden.items():
            changed = self.candidate(name).applied(changed, value)
        (recording,) = dataset.recordings
        for group, values in simulator.run(changed).items():
            recording.measured[group][:] = values + DEVIATIONS.get(group, 0.02) * rng.standard_normal(values.shape)
        nuisance_fit = NuisanceFit(simulator, masks, vehicle, base, relinearise=True)
        self.fitter = nuisance_fit.fitter
        self.bare, self.noise = nuisance_fit.fit(*self.fitter.start())
        self.fitter = self.fitter.with_simulator(nuisance_fit.fitter.simulator)  # inputs denoised where the fit ended

    def candidate(self, name: str) -> Candidate:
        return next(one for one in self.candidates.candidates if one.name == name)

    def hypothesis(self, model: Model) -> FittedHypothesis:
        return refitted(unscored(model, self.noise, 1.0), model, self.noise)

    def fitted(self, names: Sequence[str], values: Sequence[float], steps: int) -> Model:
        terms = [Term(self.candidate(name), value) for name, value in zip(names, values, strict=True)]
        return self.fitter.fit(self.fitter.at(self.bare.z, terms, self.noise), self.noise, steps)


@pytest.fixture(scope="module")
def driven() -> _Driven:
    return _Driven({"residual_drag@fl": 25.0})


def test_a_fit_that_stopped_on_its_way_goes_on_from_where_the_best_ended(driven):
    best = driven.hypothesis(driven.fitted(["residual_drag@fl"], [20.0], 8))
    stopped = driven.hypothesis(driven.fitted(["rolling_resistance@fl"], [0.01], 0))
    assert criterion(stopped) - criterion(best) > 50.0
    same, further = refit_from_best(driven.fitter, [best, stopped])
    assert same is best
    assert criterion(further) < criterion(stopped) - 50.0
    assert further.term.value > 0.5


def test_what_acts_alike_needs_no_fit_once_its_value_is_found(driven):
    best = driven.hypothesis(driven.fitted(["residual_drag@fl"], [20.0], 8))
    start = driven.fitter.at(best.model.z, [Term(driven.candidate("rolling_resistance@fl"), 0.01)], driven.noise)
    sized = driven.fitter.refit_amplitudes(start, driven.noise)
    assert (sized.z == best.model.z).all()
    assert sized.cost - best.cost < 0.2 * (start.cost - best.cost)


def _singles(driven: _Driven, names: Sequence[str], values: Sequence[float]) -> list[FittedHypothesis]:
    """Single causes that would take the place of these."""
    model = driven.fitted(names, values, 8)
    driven.candidates.linearise_at(driven.fitter.at_baseline(driven.bare), driven.bare)
    accepted = [driven.hypothesis(replace(model, terms=model.terms[:k])) for k in (1, 2)]
    return try_single_cause(driven.fitter, driven.candidates, accepted, model, driven.noise)[0]


@pytest.mark.slow
def test_one_cause_takes_the_place_of_two_that_imitate_it(driven):
    first, *_ = _singles(driven, ["tyre_radius@fl", "rolling_resistance@car"], [0.001, 0.2])
    assert first.term.candidate.effect.name in ("residual_drag", "stuck_corner")
    assert first.term.candidate.location == "fl"


@pytest.mark.slow
def test_two_that_are_there_stay():
    hidden = {"residual_drag@fl": 25.0, "pressure_offset@rr": 1e5}
    assert _singles(_Driven(hidden), list(hidden), list(hidden.values())) == []

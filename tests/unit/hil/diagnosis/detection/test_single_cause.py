"""Causes that act alike end alike, and one cause takes the place of two that imitate it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refit_from_best, refitted
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.single_cause import try_single_cause
from hil.diagnosis.estimation.gauss_newton import Model, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import paper_car

DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}


class _Driven:
    """A drive with something hidden, and what is found beside nothing."""

    def __init__(self, hidden: dict[str, float]) -> None:
        vehicle = paper_car()
        case = prepare([log_as_driven(vehicle, 0.308)], 0.308)
        rig, base, rng = Simulator(case, vehicle), nominal(vehicle), np.random.default_rng(3)
        self.field = CandidateSet(rig, SampleMasks.of(case), ())
        world = base
        for name, value in hidden.items():
            world = self.candidate(name).applied(world, value)
        (drive,) = case.recordings
        for group, told in rig.run(world).items():
            drive.measured[group][:] = told + DEVIATIONS.get(group, 0.02) * rng.standard_normal(told.shape)
        self.numbers = NuisanceFit(rig, SampleMasks.of(case), vehicle, base, relinearise=True)
        self.fitter = self.numbers.fitter
        self.bare, self.noise = self.numbers.fit(*self.fitter.start())
        self.case, self.vehicle = case, vehicle

    def candidate(self, name: str) -> Candidate:
        (found,) = [one for one in self.field.candidates if one.name == name]
        return found

    def contender(self, model: Model, noise: Noise) -> FittedHypothesis:
        return refitted(FittedHypothesis(model.terms[-1], model, model.cost, 0.0, 1.0, noise), model, noise)

    def fitted(self, names: Sequence[str], values: Sequence[float], steps: int) -> Model:
        terms = [Term(self.candidate(name), value) for name, value in zip(names, values, strict=True)]
        return self.fitter.fit(self.fitter.at(self.bare.z, terms, self.noise), self.noise, steps)


@pytest.fixture(scope="module")
def driven() -> _Driven:
    return _Driven({"residual_drag@fl": 25.0})


def test_a_fit_that_stopped_on_its_way_goes_on_from_where_the_best_ended(driven):
    best = driven.contender(driven.fitted(["residual_drag@fl"], [20.0], 8), driven.noise)
    stopped = driven.contender(driven.fitted(["rolling_resistance@fl"], [0.01], 0), driven.noise)
    assert criterion(stopped) - criterion(best) > 50.0
    same, further = refit_from_best(driven.fitter, [best, stopped])
    assert same is best
    assert criterion(further) < criterion(stopped) - 50.0
    assert further.term.value > 0.5


def test_what_acts_alike_needs_no_fit_once_its_value_is_found(driven):
    best = driven.contender(driven.fitted(["residual_drag@fl"], [20.0], 8), driven.noise)
    begun = driven.fitter.at(best.model.z, [Term(driven.candidate("rolling_resistance@fl"), 0.01)], driven.noise)
    sized = driven.fitter.sized(begun, driven.noise)
    assert (sized.z == best.model.z).all()
    assert sized.cost - best.cost < 0.2 * (begun.cost - best.cost)


def _singles(driven: _Driven, names: Sequence[str], values: Sequence[float]) -> list[FittedHypothesis]:
    """Single causes that would take the place of these."""
    model = driven.fitted(names, values, 8)
    driven.field.linearise_at(driven.fitter, driven.bare)
    accepted = [[driven.contender(replace(model, terms=model.terms[:k]), driven.noise)] for k in (1, 2)]
    found = Diagnosis(
        driven.case, driven.vehicle, driven.fitter, driven.noise, driven.noise, driven.bare, driven.bare, model,
        hypotheses=accepted,
    )  # fmt: skip
    return try_single_cause(driven.fitter, driven.field, found, model, driven.noise)


@pytest.mark.slow
def test_one_cause_takes_the_place_of_two_that_imitate_it(driven):
    first, *_ = _singles(driven, ["tyre_radius@fl", "rolling_resistance@car"], [0.001, 0.2])
    assert first.term.candidate.effect.name in ("residual_drag", "stuck_corner")
    assert first.term.candidate.location == "fl"


@pytest.mark.slow
def test_two_that_are_there_stay():
    hidden = {"residual_drag@fl": 25.0, "pressure_offset@rr": 1e5}
    assert _singles(_Driven(hidden), list(hidden), list(hidden.values())) == []

"""Shortlists: of two the better fit of each candidate; the one at the nominal vehicle."""

from typing import Any

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection import forward_step
from hil.diagnosis.detection.profile_fit import FittedHypothesis, fit_shortlist, merge_best
from hil.diagnosis.detection.score_test import score
from hil.diagnosis.detection.stepwise import diagnose
from hil.diagnosis.estimation.model import Term
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

_DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}
CANDIDATES = {c.name: c for c in candidates(columns())}


def _shortlist(**costs: float) -> tuple[list[Any], list[FittedHypothesis]]:
    nothing: Any = None
    listed = [(CANDIDATES[f"{name}@car"], cost) for name, cost in costs.items()]
    fitted = [FittedHypothesis(Term(one, 1.0), nothing, cost, 0.0, 1.0, nothing) for one, cost in listed]
    return [score(one, 1.0, 1.0) for one, _ in listed], fitted


def test_of_what_is_in_two_shortlists_the_better_fit_stays() -> None:
    """A fit from nuisance parameters that absorbed a cause ends worse than one from the nominal vehicle, or better."""
    top, fitted = merge_best(
        _shortlist(mass_offset=-50.0, road_grade=-30.0), _shortlist(road_grade=-70.0, motor_tau=-20.0)
    )
    assert [c.term.candidate.name for c in fitted] == ["mass_offset@car", "road_grade@car", "motor_tau@car"]
    assert [c.cost for c in fitted] == [-50.0, -70.0, -20.0]
    assert [item.candidate for item in top] == [c.term.candidate for c in fitted]
    _, fitted = merge_best(_shortlist(road_grade=-70.0), _shortlist(road_grade=-30.0))
    assert [c.cost for c in fitted] == [-70.0]


def test_two_empty_shortlists_are_empty() -> None:
    assert merge_best(([], []), ([], [])) == ([], [])


@pytest.mark.slow
def test_a_cause_that_nuisance_parameters_absorbed_is_shortlisted_at_the_nominal_vehicle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first shortlist is empty, as if they had absorbed all of it."""
    vehicle = load_vehicle(VEHICLE)
    dataset, base = prepare([log_as_driven(vehicle, 0.318)], 0.318), nominal(vehicle)
    rng = np.random.default_rng(2)
    (recording,) = dataset.recordings
    hidden = CANDIDATES["tyre_radius@rl"].applied(base, -0.02)
    for group, values in Simulator(dataset, vehicle).run(hidden).items():
        recording.measured[group][:] = values + _DEVIATIONS.get(group, 0.02) * rng.standard_normal(values.shape)
    calls: list[bool] = []

    def empty_at_first(*given: Any) -> tuple[list[Any], list[FittedHypothesis]]:
        calls.append(True)
        return ([], []) if len(calls) == 1 else fit_shortlist(*given)

    monkeypatch.setattr(forward_step, "fit_shortlist", empty_at_first)
    monkeypatch.setattr(forward_step, "BIASED_BIRGE_RATIO", 0.0)
    (term,) = diagnose(dataset, vehicle, base).final.terms
    assert term.candidate.name == "tyre_radius@rl"
    assert term.value == pytest.approx(-0.02, abs=0.002)

"""Who leads a race for a cause: of two races the better fit of each, and the one from the car as handed in."""

from typing import Any

import numpy as np
import pytest
from outsider import VEHICLE
from pulses import log_as_driven

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.detection import stepwise as diagnose
from hil.diagnosis.detection.profile_fit import FittedHypothesis
from hil.diagnosis.detection.score_test import score
from hil.diagnosis.detection.shortlist import fit_shortlist, merge_best
from hil.diagnosis.estimation.gauss_newton import Term
from hil.diagnosis.estimation.terms import candidates, columns
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

_DEVIATIONS = {"wheel": 0.02, "ax": 0.02, "gps": 0.03, "pressure": 1e4, "motor": 0.5}
CANDIDATES = {c.name: c for c in candidates(columns())}


def _led(**costs: float) -> tuple[list[Any], list[FittedHypothesis]]:
    nothing: Any = None
    listed = [(CANDIDATES[f"{name}@car"], cost) for name, cost in costs.items()]
    fitted = [FittedHypothesis(Term(one, 1.0), nothing, cost, 0.0, 1.0, nothing) for one, cost in listed]
    return [score(one, 1.0, 1.0) for one, _ in listed], fitted


def test_of_what_leads_two_races_the_better_fit_stays() -> None:
    """A fit from numbers that stand in for a cause ends worse than one from the car as handed in, or better."""
    top, fitted = merge_best(_led(mass_offset=-50.0, road_grade=-30.0), _led(road_grade=-70.0, motor_tau=-20.0))
    assert [c.term.candidate.name for c in fitted] == ["mass_offset@car", "road_grade@car", "motor_tau@car"]
    assert [c.cost for c in fitted] == [-50.0, -70.0, -20.0]
    assert [item.candidate for item in top] == [c.term.candidate for c in fitted]
    _, fitted = merge_best(_led(road_grade=-70.0), _led(road_grade=-30.0))
    assert [c.cost for c in fitted] == [-70.0]


def test_nobody_leads_where_nobody_leads_either_race() -> None:
    assert merge_best(([], []), ([], [])) == ([], [])


@pytest.mark.slow
def test_a_cause_that_bent_numbers_leave_nothing_of_leads_as_seen_from_the_car_as_handed_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the numbers stand nobody leads, as if they had stood in for all of it."""
    vehicle = load_vehicle(VEHICLE)
    case, base = prepare([log_as_driven(vehicle, 0.318)], 0.318), nominal(vehicle)
    rng = np.random.default_rng(2)
    (drive,) = case.recordings
    for group, told in Simulator(case, vehicle).run(CANDIDATES["tyre_radius@rl"].applied(base, -0.02)).items():
        drive.measured[group][:] = told + _DEVIATIONS.get(group, 0.02) * rng.standard_normal(told.shape)
    races: list[bool] = []

    def blind_at_first(*given: Any) -> tuple[list[Any], list[FittedHypothesis]]:
        races.append(True)
        return ([], []) if len(races) == 1 else fit_shortlist(*given)

    monkeypatch.setattr(diagnose, "fitted_leaders", blind_at_first)
    monkeypatch.setattr(diagnose, "STRAINED", 0.0)
    found = diagnose.diagnose(case, vehicle, base)
    (term,) = found.final.terms
    assert term.candidate.name == "tyre_radius@rl"
    assert term.value == pytest.approx(-0.02, abs=0.002)

"""Who leads a race for a cause: of two races the better fit of each."""

from typing import Any

from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Term
from hil.study.search.contest import Contender
from hil.study.search.leading import together
from hil.study.search.screen import score

CANDIDATES = {c.name: c for c in candidates(columns())}


def _led(**costs: float) -> tuple[list[Any], list[Contender]]:
    nothing: Any = None
    listed = [(CANDIDATES[f"{name}@car"], cost) for name, cost in costs.items()]
    fitted = [Contender(Term(one, 1.0), nothing, cost, 0.0, 1.0, nothing) for one, cost in listed]
    return [score(one, 1.0, 1.0) for one, _ in listed], fitted


def test_of_what_leads_two_races_the_better_fit_stays() -> None:
    """A fit from numbers that stand in for a cause ends worse than one from the car as handed in, or better."""
    top, fitted = together(_led(mass_offset=-50.0, road_grade=-30.0), _led(road_grade=-70.0, motor_tau=-20.0))
    assert [c.term.candidate.name for c in fitted] == ["mass_offset@car", "road_grade@car", "motor_tau@car"]
    assert [c.cost for c in fitted] == [-50.0, -70.0, -20.0]
    assert [item.candidate for item in top] == [c.term.candidate for c in fitted]
    _, fitted = together(_led(road_grade=-70.0), _led(road_grade=-30.0))
    assert [c.cost for c in fitted] == [-70.0]


def test_nobody_leads_where_nobody_leads_either_race() -> None:
    assert together(([], []), ([], [])) == ([], [])

"""The answer: when rivals are decided by what is usual."""

from types import SimpleNamespace
from typing import Any

import pytest

from hil.study.fitting.candidates import candidates, columns
from hil.study.fitting.fit import Term
from hil.study.search.contest import Contender
from hil.study.verdict.answer import _undecided
from hil.study.verdict.tied import Tied

CANDIDATES = {c.name: c for c in candidates(columns())}
PADS, CORNER, CALIPER = "pad_mu_gain@fr", "stuck_corner.loss@fr", "caliper_asymmetry@fr"


def _found(behind: dict[str, float]) -> Any:
    nothing: Any = None
    listed = [Contender(Term(CANDIDATES[PADS], -0.03), nothing, 0.0, 0.0, 1.0, nothing)]
    listed += [Contender(Term(CANDIDATES[name], 0.03), nothing, by, 0.0, 1.0, nothing) for name, by in behind.items()]
    screened = [SimpleNamespace(candidate=CANDIDATES[name]) for name in (PADS, CORNER, CALIPER)]
    return SimpleNamespace(races=[listed], screened=screened)


@pytest.mark.parametrize(("behind", "left"), [
    ({CORNER: 3.0}, (1,)), ({CORNER: 5.0}, ()), ({CORNER: 5.0, CALIPER: 3.0}, (2,)), ({}, (1, 2)),
])  # fmt: skip
def test_the_same_law_by_another_name_is_decided_by_what_is_usual(
    behind: dict[str, float], left: tuple[int, ...]
) -> None:
    """Ten to one; what nobody fitted is not decided."""
    pairs = tuple((k, 0.1) for k, name in ((1, CORNER), (2, CALIPER)) if name in behind or not behind)
    assert _undecided(_found(behind), Tied((1,) if pairs else (), (0.03,), 0.1, 6.0, pairs)) == left


def test_several_together_are_not_decided_one_by_one() -> None:
    tied = Tied((1, 2), (0.03, 0.03), 0.5, 6.0, ())
    assert _undecided(_found({CORNER: 50.0, CALIPER: 50.0}), tied) == (1, 2)

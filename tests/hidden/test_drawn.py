"""Twelve single causes and twelve times nothing, drawn anew whenever the engine changes.

How many may be wrong is decided over all cases, at the end of the session (`tests/support/drawn.py`).
"""

from collections.abc import Iterator
from functools import cache
from itertools import islice

import drawn
import numpy as np
import pytest

from hil.validation.blind_trials.run import run_case
from hil.validation.blind_trials.separable import effect_separable
from hil.validation.reference_car.case import Case
from hil.validation.reference_car.cases import SEPARABLE, draw

SNR = 15.0
pytestmark = [pytest.mark.slow, pytest.mark.drawn]


def _singles(seed: int) -> Iterator[Case]:
    """Cases that reach the size asked for and can be told from all others, effects in a drawn order."""
    for index in np.random.default_rng(seed).permutation(len(SEPARABLE)):
        case = draw("single", int(index), seed, SNR)
        (hidden,) = case.hidden
        if case.reached and effect_separable(hidden.effect, hidden.wheel, case.noise_level, SNR):
            yield case


@cache
def _drawn(seed: int) -> list[Case]:
    return list(islice(_singles(seed), drawn.COUNT))


@pytest.mark.parametrize("number", range(drawn.COUNT))
def test_a_drawn_single_cause_is_named(number, outcome):
    seed = drawn.seed()
    case = _drawn(seed)[number]
    record = run_case(case, seed, SNR)
    effect = record["hidden"][0]["effect"]
    named = record["named"][:1] == [effect]
    outcome(
        drawn.SINGLE, number, "" if named else f"case {case.index}, {effect}: {record['verdict']} {record['named']}"
    )


@pytest.mark.parametrize("number", range(drawn.COUNT))
def test_where_nothing_is_drawn_nothing_is_named(number, outcome):
    seed = drawn.seed()
    record = run_case(draw("null", number, seed), seed, None)
    outcome(drawn.NULL, number, "" if not record["causes"] else f"{record['verdict']} {record['named']}")

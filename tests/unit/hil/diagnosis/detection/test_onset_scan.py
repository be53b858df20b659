"""Candidates that begin in the middle: seen from the manoeuvre on that shows them, never for nothing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.detection.onset import OnsetTime
from hil.diagnosis.detection.onset_scan import scan_onset_by_segment
from hil.diagnosis.detection.score_test import ScoreTest, scores
from hil.diagnosis.estimation.information import InformationBlocks, marginalise
from hil.diagnosis.estimation.terms import candidates, columns

PRICE = 13.0
SAMPLES, MANOEUVRES = 200, 8
BEGINS = [(k // 2, 10.0 * (k % 2)) for k in range(MANOEUVRES)]
ONE_LOG = [(0, 10.0 * k) for k in range(MANOEUVRES)]


def _screened(
    begin: int | None, strength: float, seed: int = 1, price: float = PRICE, begins: Sequence[OnsetTime] = BEGINS
) -> tuple[ScoreTest, ScoreTest]:
    """A drag that begins with a manoeuvre, ``strength`` standard deviations in all, as told, and as screened."""
    (drag,) = [replace(one, columns=(0,)) for one in candidates(columns()) if one.name == "residual_drag@car"]
    rng = np.random.default_rng(seed)
    signature = np.ones((MANOEUVRES, SAMPLES)) / 5.0
    nuisance = 0.01 * rng.standard_normal((MANOEUVRES, SAMPLES))
    residual = rng.standard_normal((MANOEUVRES, SAMPLES))
    if begin is not None:
        left = (MANOEUVRES - begin) * SAMPLES
        residual[begin:] += strength / left**0.5
    rows = np.stack((residual, nuisance, signature), axis=2)
    sums = InformationBlocks(np.einsum("msi,msj->mij", rows, rows), 1, SAMPLES * MANOEUVRES, 0.0)
    z = np.zeros(1)
    listed = scores([drag], marginalise(sums.total(), 1, (), z), 0, [0.0])
    return listed[0], scan_onset_by_segment(listed, sums, 0, z, [], begins, price)[0]


@pytest.mark.parametrize("begin", [2, 3, 5])
def test_a_cause_in_the_second_half_explains_more_from_there_on(begin: int) -> None:
    always, later = _screened(begin, 15.0)
    assert later.onset == BEGINS[begin]
    assert later.gain > always.gain
    assert later.value == pytest.approx(5.0 * 15.0 / ((MANOEUVRES - begin) * SAMPLES) ** 0.5, rel=0.3)


def test_what_was_always_there_or_is_nothing_begins_nowhere() -> None:
    assert _screened(0, 15.0)[1].onset is None
    assert all(_screened(None, 0.0, seed)[1].onset is None for seed in range(50))


def test_what_one_log_alone_shows_may_be_the_model_that_errs_there() -> None:
    assert _screened(6, 12.0)[1].onset is None


def test_in_a_single_log_more_than_one_manoeuvre_has_to_show_it() -> None:
    assert _screened(4, 12.0, begins=ONE_LOG)[1].onset == ONE_LOG[4]
    assert _screened(7, 12.0, begins=ONE_LOG)[1].onset is None


def test_the_choice_of_a_time_has_its_price() -> None:
    (_, priced), (_, free) = _screened(5, 12.0), _screened(5, 12.0, price=0.0)
    assert free.gain - priced.gain == pytest.approx(PRICE)
    assert free.log_bayes_factor - priced.log_bayes_factor == pytest.approx(0.5 * PRICE)

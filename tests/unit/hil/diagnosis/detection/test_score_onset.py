"""Score tests from an onset on: from the segment that shows the cause, never for nothing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hil.diagnosis.detection.score_test import OnsetTime, ScoreTest, scan_onset_by_segment, scores
from hil.diagnosis.estimation.information import InformationBlocks, marginalise
from hil.diagnosis.estimation.terms import candidates, columns

PENALTY = 13.0
SAMPLES, SEGMENTS = 200, 8
STARTS = [(k // 2, 10.0 * (k % 2)) for k in range(SEGMENTS)]
ONE_LOG = [(0, 10.0 * k) for k in range(SEGMENTS)]


def _scanned(
    onset: int | None, strength: float, seed: int = 1, penalty: float = PENALTY, starts: Sequence[OnsetTime] = STARTS
) -> tuple[ScoreTest, ScoreTest]:
    """A drag from a segment on, ``strength`` standard deviations in all: ever-present, and with the best onset."""
    (drag,) = [replace(one, columns=(0,)) for one in candidates(columns()) if one.name == "residual_drag@car"]
    rng = np.random.default_rng(seed)
    signature = np.ones((SEGMENTS, SAMPLES)) / 5.0
    nuisance = 0.01 * rng.standard_normal((SEGMENTS, SAMPLES))
    residual = rng.standard_normal((SEGMENTS, SAMPLES))
    if onset is not None:
        left = (SEGMENTS - onset) * SAMPLES
        residual[onset:] += strength / left**0.5
    rows = np.stack((residual, nuisance, signature), axis=2)
    blocks = InformationBlocks(np.einsum("msi,msj->mij", rows, rows), 1, SAMPLES * SEGMENTS, 0.0)
    z = np.zeros(1)
    tests = scores([drag], marginalise(blocks.total(), 1, (), z), 0, [0.0])
    return tests[0], scan_onset_by_segment(tests, blocks, 0, z, [], starts, penalty)[0]


@pytest.mark.parametrize("onset", [2, 3, 5])
def test_a_cause_in_the_second_half_explains_more_from_there_on(onset: int) -> None:
    always, later = _scanned(onset, 15.0)
    assert later.onset == STARTS[onset]
    assert later.gain > always.gain
    assert later.value == pytest.approx(5.0 * 15.0 / ((SEGMENTS - onset) * SAMPLES) ** 0.5, rel=0.3)


def test_what_was_always_there_or_is_nothing_has_no_onset() -> None:
    assert _scanned(0, 15.0)[1].onset is None
    assert all(_scanned(None, 0.0, seed)[1].onset is None for seed in range(50))


def test_what_one_log_alone_shows_may_be_the_model_that_errs_there() -> None:
    assert _scanned(6, 12.0)[1].onset is None


def test_in_a_single_log_more_than_one_segment_has_to_show_it() -> None:
    assert _scanned(4, 12.0, starts=ONE_LOG)[1].onset == ONE_LOG[4]
    assert _scanned(7, 12.0, starts=ONE_LOG)[1].onset is None


def test_the_choice_of_a_time_has_its_penalty() -> None:
    (_, penalised), (_, free) = _scanned(5, 12.0), _scanned(5, 12.0, penalty=0.0)
    assert free.gain - penalised.gain == pytest.approx(PENALTY)
    assert free.log_bayes_factor - penalised.log_bayes_factor == pytest.approx(0.5 * PENALTY)

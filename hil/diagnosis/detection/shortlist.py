"""Who leads a race for one more cause, looked at with noise of its own, and the fits of those that may be one."""

from collections.abc import Sequence

from hil.diagnosis.detection.candidates import candidate_key
from hil.diagnosis.detection.form_error import FormErrorAllowance
from hil.diagnosis.detection.profile_fit import CandidateFits, FittedHypothesis, criterion
from hil.diagnosis.detection.result import Diagnosis, Progress
from hil.diagnosis.detection.score_test import SHORTLIST_SIZE, ScoreTest, shortlist
from hil.diagnosis.estimation.model_discrepancy import variance_inflation
from hil.diagnosis.parallel import thread_map

_TRIED = 10
"""Leaders where the vehicle's numbers go far, places of one effect among them."""
_HOPELESS, _POOR = 0.1, 0.4
"""Shares of the gain asked: below the one no candidate is looked at with noise of its own, below the other none is
fitted but as a rival of one that is beyond doubt."""


def fit_shortlist(
    contest: CandidateFits,
    plausible: Sequence[ScoreTest],
    left: FormErrorAllowance,
    found: Diagnosis,
    bent: bool,
    say: Progress,
) -> tuple[list[ScoreTest], list[FittedHypothesis]]:
    """Leaders among those that explain most by one step, and their fits; none where none can be beyond doubt.

    ``bent``: whether something may have bent the vehicle's numbers, and the order with them.
    """
    if _most(plausible, left) < _HOPELESS * found.detection_threshold:
        return [], []
    say(f"noise beside {len(plausible)} candidates")
    seen = thread_map(contest.profile_over_noise, plausible)
    beside = {id(item): quieter for item, quieter in seen}
    looked = [item for item, _ in seen]
    top = sorted(looked, key=lambda s: -s.log_bayes_factor)[:_TRIED] if bent else shortlist(looked, SHORTLIST_SIZE)
    if _most(top, left) < _POOR * found.detection_threshold:
        return [], []
    least = found.detection_threshold / found.inflation  # beside the best as fitted it may be no more

    def fits(some: Sequence[ScoreTest]) -> list[FittedHypothesis]:
        say(f"fitting {len(some)} leaders")
        return thread_map(lambda item: contest.fit(item, beside[id(item)]), some)

    first = [item for item in top if bent or _beyond(item, item.gain, left) >= _POOR * least]
    fitted = fits(first)
    gains = [(contest.reference - c.cost) / variance_inflation(c.term.candidate) for c in fitted]
    rest = [item for item in top if item not in first]
    if rest and any(_beyond(*one, left) >= least for one in zip(first, gains, strict=True)):
        return [*first, *rest], [*fitted, *fits(rest)]
    return first, fitted


def merge_best(
    some: tuple[list[ScoreTest], list[FittedHypothesis]], others: tuple[list[ScoreTest], list[FittedHypothesis]]
) -> tuple[list[ScoreTest], list[FittedHypothesis]]:
    """Leaders and their fits of two races, of what led in both the better fit."""
    best: dict[tuple[str, str, str], tuple[ScoreTest, FittedHypothesis]] = {}
    for item, one in (*zip(*some, strict=True), *zip(*others, strict=True)):
        name = candidate_key(item.candidate)
        if name not in best or criterion(one) < criterion(best[name][1]):
            best[name] = item, one
    return [item for item, _ in best.values()], [one for _, one in best.values()]


def _beyond(item: ScoreTest, gain: float, left: FormErrorAllowance) -> float:
    """What a candidate gains beyond what the causes in the model may leave."""
    return gain - left.of(item.candidate) / variance_inflation(item.candidate)


def _most(listed: Sequence[ScoreTest], left: FormErrorAllowance) -> float:
    """Most that a candidate gains so by one step."""
    return max((_beyond(item, item.gain, left) for item in listed), default=0.0)

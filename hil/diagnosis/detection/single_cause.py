"""One cause instead of all that a model has: a cause that was looked for on bent numbers may have been made of others.

The search adds causes one at a time. A drag of one wheel, which the vehicle's numbers had taken up, was told as an
offset of the steering and a radius of that wheel. Beside those the numbers are right again, and what they hid is seen.
"""

from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.onset import OnsetTime, onset_penalty
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion, refitted
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import SHORTLIST_SIZE, ScoreTest, shortlist
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map


def try_single_cause(
    fitter: Fitter, field: CandidateSet, found: Diagnosis, model: Model, noise: Noise
) -> tuple[list[FittedHypothesis], Fitter]:
    """Single causes fitted from the numbers and the noise of a model of several, best first; empty where all of the
    model together have the better odds. The fitter comes back with the baseline they are fitted from."""
    bare = fitter.at(model.z, (), noise)
    moments: list[OnsetTime | None] = list(dict.fromkeys(term.onset for term in model.terms))
    if None in moments:
        fitter = fitter.at_baseline(bare)
    tried = [(item, moment) for moment in moments for item in _leading(fitter, field, bare, noise, moment)]

    def fitted(item: ScoreTest, moment: OnsetTime | None) -> FittedHypothesis:
        term = Term(item.candidate, item.value, moment)
        single = fitter.fit(fitter.at(model.z, (term,), noise), noise, 3)
        paid = 0.0 if moment is None else onset_penalty(fitter.masks)
        begun = FittedHypothesis(single.terms[0], single, single.cost, 0.0, item.information, noise, onset_penalty=paid)
        return refitted(begun, single, noise)

    singles = sorted(thread_map(lambda one: fitted(*one), tried), key=criterion)
    accepted = [listed[0] for listed in found.selections]
    together = model.cost + sum(one.total_penalty - 2.0 * one.log_occam_factor for one in accepted)
    return (singles if singles and criterion(singles[0]) < together else []), fitter


def _leading(
    fitter: Fitter, field: CandidateSet, bare: Model, noise: Noise, moment: OnsetTime | None
) -> list[ScoreTest]:
    if moment is not None:
        return shortlist(field.scores_from_onset(fitter, bare, noise, moment), SHORTLIST_SIZE)
    sums = fitter.information_blocks(bare, field.jacobian, noise)
    return shortlist([item for item in field.scores(fitter, sums, bare, noise) if not item.replayed], SHORTLIST_SIZE)

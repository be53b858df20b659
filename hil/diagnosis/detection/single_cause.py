"""One cause instead of all that a model has: a cause that was looked for on bent numbers may have been made of others.

The search adds causes one at a time. A drag of one wheel, which the vehicle's numbers had taken up, was told as an
offset of the steering and a radius of that wheel. Beside those the numbers are right again, and what they hid is seen.
"""

from hil.diagnosis.detection.candidates import Field
from hil.diagnosis.detection.onset import Moment, price
from hil.diagnosis.detection.profile_fit import Contender, Contest, odds, refitted
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import LEADERS, Score, leaders
from hil.diagnosis.estimation.gauss_newton import Fitter, Model, Term
from hil.diagnosis.noise.model import Noise


def one_for_all(fitter: Fitter, field: Field, found: Diagnosis, model: Model, noise: Noise) -> list[Contender]:
    """Single causes fitted from the numbers and the noise of a model of several, best first; empty where all of the
    model together have the better odds."""
    bare = fitter.at(model.z, (), noise)
    moments: list[Moment | None] = list(dict.fromkeys(term.onset for term in model.terms))
    tried = [(item, moment) for moment in moments for item in _leading(fitter, field, bare, noise, moment)]

    def fitted(item: Score, moment: Moment | None) -> Contender:
        term = Term(item.candidate, item.value, moment)
        single = fitter.fit(fitter.at(model.z, (term,), noise), noise, 3)
        paid = 0.0 if moment is None else price(fitter.frame)
        begun = Contender(single.terms[0], single, single.cost, 0.0, item.information, noise, price=paid)
        return refitted(begun, single, noise)

    singles = sorted(Contest.at_once(lambda one: fitted(*one), tried), key=odds)
    accepted = [listed[0] for listed in found.races]
    together = model.cost + sum(one.paid - 2.0 * one.evidence for one in accepted)
    return singles if singles and odds(singles[0]) < together else []


def _leading(fitter: Fitter, field: Field, bare: Model, noise: Noise, moment: Moment | None) -> list[Score]:
    if moment is not None:
        return leaders(field.begun_at(fitter, bare, noise, moment), LEADERS)
    sums = fitter.screen(bare, field.tracks, noise)
    return leaders([item for item in field.scores(fitter, sums, bare, noise) if not item.replayed], LEADERS)

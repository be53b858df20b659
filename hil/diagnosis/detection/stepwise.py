"""The diagnosis: noise first, then nuisances, then one cause at a time, fitted non-linearly before it is believed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import Case
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.candidates import Field, number_of, quiet_nodes
from hil.diagnosis.detection.form_error import LeftOver
from hil.diagnosis.detection.nonparametric import Piece
from hil.diagnosis.detection.nonparametric_search import Round, Unlisted
from hil.diagnosis.detection.onset import with_onsets
from hil.diagnosis.detection.onset_alternatives import since_when, with_its_like
from hil.diagnosis.detection.profile_fit import (
    Contender,
    Contest,
    at_its_end,
    from_the_best,
    instead,
    odds,
    refitted,
)
from hil.diagnosis.detection.restart import Refitted, from_handed_in
from hil.diagnosis.detection.result import Diagnosis, Say, Settings, causes_in
from hil.diagnosis.detection.score_test import Score, not_testable
from hil.diagnosis.detection.shortlist import fitted_leaders, together
from hil.diagnosis.detection.significance import backward, beyond_doubt, stands_beside, with_gain
from hil.diagnosis.detection.single_cause import one_for_all
from hil.diagnosis.detection.threshold import Asked, errors
from hil.diagnosis.estimation.aliases import restated
from hil.diagnosis.estimation.gauss_newton import STRAINED, Fitter, Model
from hil.diagnosis.estimation.nuisance_fit import Numbers
from hil.diagnosis.noise.model import Frame, Noise
from hil.diagnosis.simulation.parameter_set import World
from hil.diagnosis.simulation.simulator import Rig
from hil.diagnosis.vehicle.spec import Vehicle

_NEAR = 0.2
"""Share of what the best explains, by one step or fitted, below which no other is fitted from the car as handed in, nor
the best at another place."""
_MISLED = 1.0 / 3.0
"""Share of what a cause explains, by which the fit without any must have been worse than it can be, for the search to
begin again from a better one."""
_LED_ANEW = 3
"""Leaders that get sensitivities of their own, when they are fitted from the car as handed in."""
Accepted = tuple[Model, Noise, list[Contender]]
"""A model with one cause more, the noise beside it, and all that were fitted in its place, best first."""


def diagnose(
    case: Case, vehicle: Vehicle, base: World, settings: Settings | None = None, say: Say | None = None
) -> Diagnosis:
    """Diagnose a case; see the module."""
    return _Search(case, vehicle, base, settings or Settings(), say or (lambda _: None)).run()


class _Search:
    def __init__(self, case: Case, vehicle: Vehicle, base: World, settings: Settings, say: Say) -> None:
        self.settings, self.say = settings, say
        self.rig = Rig(case, vehicle).quieted(base)
        self.frame = Frame.of(self.rig.case)
        self.numbers = Numbers(self.rig, self.frame, vehicle, base, settings.relinearise)
        self.unlisted = Unlisted(self.numbers, settings, say)
        self.told = float(len(self.numbers.nuisances))
        self.began_again = False

    @property
    def fitter(self) -> Fitter:
        """With the sensitivities to the vehicle's numbers last taken."""
        return self.numbers.fitter

    def run(self) -> Diagnosis:
        """All of it."""
        self.say("replaying the car as handed in")
        self.numbers.anew(np.zeros(len(self.numbers.nuisances)))
        self.handed_in = self.fitter
        nominal, noise = self.fitter.start(self.settings.noise_model)
        self.say("noise, and the vehicle's numbers within their tolerance")
        model, noise = self.numbers.fitted(nominal, noise)
        if self.rig.align(self.fitter.world(model.z, ())):
            model, noise = self.numbers.fitted(self.fitter.at(model.z, (), noise), noise)
        quiet = quiet_nodes(self.fitter.of_stack(model.stack or self.rig.run(self.fitter.world(model.z, ()))), noise)
        self.field = Field(self.rig, self.frame, self.rig.vehicle.untold, quiet)
        found = Diagnosis(self.rig.case, self.rig.vehicle, self.fitter, noise, noise, nominal, model, model)
        self._screened(found)
        around = model.z
        while causes_in(model) < self.settings.most_causes:
            accepted = self._next(found, model, noise)
            if accepted is None:
                break
            before, (model, noise, list_of) = len(model.terms), accepted
            if not list_of:
                model, noise = self._again(found, model, noise)
                around = model.z
                continue
            found.contenders += [list_of] * (len(model.terms) - before)
            model, noise = self._one_for_all(found, model, noise)
            self.say(f"accepted {model.terms[-1].candidate.name} = {model.terms[-1].value:.4g}; when it begins")
            model = with_onsets(self.fitter, model, noise)
            model = self._quieter(model, noise)
            model, noise, around = self._bent_back(model, noise, around)
            bent, model = model, restated(model, self.numbers.nuisances, self.fitter.base)
            around = around + model.z - bent.z
        if model.terms:
            bare = found.fitter
            found.final, found.noise, found.fitter = model, noise, self.fitter
            backward(found, bare, self.told, self.say)
        for term in filter(at_its_end, found.final.terms):
            told = f"{term.candidate.name} = {term.value:.3g}"
            found.remarks.append(f"{told} is the end of its range: the true value may lie beyond")
        return found

    def _screened(self, found: Diagnosis) -> None:
        """What each candidate explains where the numbers alone explain all they can, and so what is asked of one."""
        self.say(f"sensitivities of {len(self.field.candidates)} candidates")
        self._shown_at(found.base)
        self.told = self.fitter.told(found.first_noise)
        found.sums = self.fitter.screen(found.base, self.field.tracks, found.first_noise)
        found.screened = self.field.scores(self.fitter, found.sums, found.base, found.first_noise)
        found.untestable = sorted({*not_testable(found.screened), *self.rig.vehicle.untold})
        self.asked = Asked(found, self.field, self.settings.alpha)
        self.asked.beside(self.fitter, found.screened, found.sums, found.base)

    def _shown_at(self, model: Model) -> None:
        """What candidates, and laws in no list, show is that at this model."""
        self.field.taken_at(self.fitter, model)
        self.unlisted.elsewhere()

    def _again(self, found: Diagnosis, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """From numbers with which the causes of a model, or none, explain more than those the search went on from."""
        self.say("once more, from numbers that explain more")
        self.numbers.anew(model.z, model.terms)
        model, noise = self.numbers.fitted(self.fitter.at(model.z, model.terms, noise), noise)
        if model.terms:
            self._shown_at(model)
        else:
            found.fitter, found.noise, found.first_noise = self.fitter, noise, noise
            found.base = found.final = model
            self._screened(found)
        return model, noise

    def _bent(self, model: Model) -> bool:
        """Whether something may have bent the vehicle's numbers."""
        return self.settings.relinearise and not model.terms and self.fitter.strain(model.z) >= STRAINED

    def _from_handed_in(
        self, model: Model, fitted: Sequence[Contender], with_fit: Refitted, reference: float, anew: int,
        best: float = np.inf,
    ) -> tuple[list[Contender], tuple[Model, Noise]]:  # fmt: skip
        """Contenders for a cause of a model fitted from the car as handed in, too; see there."""
        self.say("once more from the car as handed in")
        found, without = from_handed_in(self.numbers, fitted, model, with_fit, reference, anew, best)
        self.rig.quieten(self.fitter.world(model.z, model.terms))
        return found, without

    def _quieter(self, model: Model, noise: Noise) -> Model:
        """The model where what drives the car is made by it: a cause may move the steps of pressures and torques."""
        if not self.settings.relinearise:
            return model
        self.rig.quieten(self.fitter.world(model.z, model.terms))
        return self.fitter.fit(self.fitter.at(model.z, model.terms, noise), noise, 2)

    def _bent_back(self, model: Model, noise: Noise, around: Floats) -> tuple[Model, Noise, Floats]:
        """The model with sensitivities to the numbers taken anew where a cause let them go back far.

        Numbers that had stood in for the cause bend what all others seem to explain.
        """
        if not self.numbers.went_far(model, around):
            return model, noise, around
        self.say("sensitivities anew beside it")
        self.numbers.beside(model.z, model.terms)
        model, noise = self.fitter.settle(self.fitter.at(model.z, model.terms, noise), noise, 2)
        return model, noise, model.z

    def _next(self, found: Diagnosis, model: Model, noise: Noise) -> Accepted | None:
        """The next cause, if one is beyond doubt; no contender where the numbers explain more without a further one."""
        left = LeftOver(found.explained, self.fitter, model, noise, self.field.tracks)
        contest, top, fitted = self._leading(found, model, noise, left)
        error = errors(self.fitter, self.field, self.told, found)
        reference, tighter = contest.reference, contest.noise

        def gained() -> list[Contender]:
            best = min(fitted, key=odds)
            return [with_gain(c, reference - left.of(c.term.candidate), error(c, best)) for c in fitted]

        if fitted and self.settings.relinearise:
            self.asked.beside_fitted(self.fitter, fitted)
            if self._bent(model) or max(one.gained for one in gained()) >= found.least_gain:
                fitted, without = self._fitted_again(model, fitted, top, reference)
                bare = without[0].cost
                worse, more = reference - bare, bare - min(c.cost for c in fitted)
                if not self.began_again and worse > max(found.least_gain, _MISLED * more):
                    self.began_again = True
                    return *without, []
                reference = min(reference, bare)
            fitted = with_its_like(self.fitter, self.field, model, since_when(self.fitter, fitted))
            self.asked.beside_fitted(self.fitter, fitted)
        elif fitted:
            fitted = since_when(self.fitter, fitted)
        listed = min(fitted, key=odds, default=None)
        if listed is not None:
            tighter = listed.noise
            reference = min(reference, self.fitter.fit(model, tighter, 3).cost)
        fitted = gained() if fitted else []
        clear = sorted((c for c in fitted if beyond_doubt(c, found.least_gain, self.fitter, self.told)), key=odds)
        now = Round(contest, model, tighter, reference, listed, bool(clear), left, error, self._bent(model))
        law = self.unlisted.best(found, now, self._from_handed_in)
        if law is not None:
            found.explained += reference - law.cost
            polished, tighter = self.fitter.settle(law.model, law.noise, 1)
            return polished, tighter, [replace(law, model=polished, term=polished.terms[-1]), *clear]
        best = self._standing(fitted, clear, found.least_gain) if fitted else None
        if best is None:
            return None
        best, clear = self._placed(found, best, clear)
        found.explained += reference - best.cost
        polished = self.fitter.fit(best.model, best.noise, 4, self.settings.relinearise)
        polished, tighter = self.fitter.settle(polished, best.noise, 2)
        rest = sorted(
            (c for c in {*fitted, *clear} if c is not best and (c in clear or odds(c) >= odds(best))), key=odds
        )
        return polished, tighter, [replace(best, model=polished, term=polished.terms[-1]), *rest]

    def _one_for_all(self, found: Diagnosis, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """The model, or one of a single cause that explains what all of its together do."""
        listed = all(not isinstance(term.candidate, Piece) for term in model.terms)
        if not (self.settings.relinearise and listed and causes_in(model) > 1):
            return model, noise
        self.say("one cause instead of all")
        singles = one_for_all(self.fitter, self.field, found, model, noise)
        if not singles:
            return model, noise
        found.contenders = [singles]
        found.explained += model.cost - singles[0].cost
        return self.fitter.settle(singles[0].model, noise, 2)

    def _leading(
        self, found: Diagnosis, model: Model, noise: Noise, left: LeftOver
    ) -> tuple[Contest, list[Score], list[Contender]]:
        """The race for the next cause, its leaders and their fits; no leader where none can be beyond doubt."""
        listed, sums = self.field.seen(self.fitter, found, model, noise)
        if model.terms:
            self.asked.beside(self.fitter, listed, sums, model)
        bent = self._bent(model)
        plausible = self.field.plausible(self.fitter, listed, sums, model, bent)
        contest = Contest(self.fitter, self.field.tracks, model, noise, self.settings.relinearise)
        leading = fitted_leaders(contest, plausible, left, found, bent, self.say)
        if bent:
            leading = together(leading, self._leading_handed_in(found, noise, left))
        return contest, *leading

    def _leading_handed_in(self, found: Diagnosis, noise: Noise, left: LeftOver) -> tuple[list[Score], list[Contender]]:
        """Leaders as seen from the car as handed in, and their fits.

        Numbers that stand in for a cause leave nothing of it where they stand.
        """
        self.say("sensitivities at the car as handed in")
        fitter = self.handed_in
        nominal = fitter.at(np.zeros(len(self.numbers.nuisances)), (), noise)
        field = self.field.at(fitter, nominal)
        sums = fitter.screen(nominal, field.tracks, noise)
        listed = field.scores(fitter, sums, nominal, noise)
        plausible = field.plausible(fitter, listed, sums, nominal, False)
        contest = Contest(fitter, field.tracks, nominal, noise, self.settings.relinearise)
        return fitted_leaders(contest, plausible, left, found, False, self.say)

    def _fitted_again(
        self, model: Model, fitted: list[Contender], top: list[Score], reference: float
    ) -> tuple[list[Contender], tuple[Model, Noise]]:
        """Contenders, those that explain much fitted from the car as handed in too, and the best fit without any."""
        explain = [max(item.raw, reference - c.cost) for c, item in zip(fitted, top, strict=True)]
        least = 0.0 if self._bent(model) else _NEAR * max(explain)
        near = [c for c, much in zip(fitted, explain, strict=True) if much >= least]
        refound, without = self._from_handed_in(model, near, refitted, reference, _LED_ANEW)
        better = dict(zip(map(id, near), from_the_best(self.fitter, refound), strict=True))
        return [better.get(id(c), c) for c in fitted], without

    def _standing(self, fitted: list[Contender], clear: list[Contender], least: float) -> Contender | None:
        """The best that is beyond doubt, beside one that explains more and is not, too."""
        if not clear:
            most = max(fitted, key=lambda c: c.gained)
            self.say(f"{most.term.candidate.name} gains {most.gained:.1f}, {least:.1f} is asked")
            return None
        better = min(fitted, key=odds)
        how = (least, self.fitter, self.told, self.settings.relinearise)
        best = next((c for c in clear if c is better or stands_beside(c, better, *how)), None)
        if best is None:
            self.say(f"{better.term.candidate.name} explains more, and the model errs there; nothing stands beside it")
        return best

    def _placed(self, found: Diagnosis, best: Contender, clear: list[Contender]) -> tuple[Contender, list[Contender]]:
        """The best where it fits best: the screen knows the places only as well as the numbers stood."""
        name = number_of(best.term.candidate)
        like = [item for item in found.screened if number_of(item.candidate)[:2] == name[:2]]
        least = _NEAR * max((item.raw for item in like if item.candidate is best.term.candidate), default=np.inf)
        places = [item.candidate for item in like if item.candidate is not best.term.candidate and item.raw >= least]
        if not self.settings.relinearise or not places:
            return best, clear
        self.say(f"{best.term.candidate.name} at other places")
        placed = [*clear, *instead(self.fitter, best, [(place, best.term.value) for place in places], True)]
        better = [one for one in placed if number_of(one.term.candidate)[:2] == name[:2] and odds(one) < odds(best)]
        return min(better, key=odds, default=best), placed

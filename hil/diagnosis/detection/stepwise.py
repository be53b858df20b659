"""The diagnosis: noise first, then nuisances, then one cause at a time, fitted non-linearly before it is believed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.candidates import CandidateSet, candidate_key, unexcited_sensors
from hil.diagnosis.detection.form_error import FormErrorAllowance
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.nonparametric_search import NonparametricSearch, SelectionStep
from hil.diagnosis.detection.onset import estimate_onsets
from hil.diagnosis.detection.onset_alternatives import add_same_onset_alternatives, estimate_onsets_of_best
from hil.diagnosis.detection.profile_fit import (
    CandidateFits,
    FittedHypothesis,
    at_bound,
    criterion,
    refit_from_best,
    refit_substitutes,
    refitted,
)
from hil.diagnosis.detection.restart import RefitHypothesis, refit_from_nominal
from hil.diagnosis.detection.result import Diagnosis, Progress, Settings, causes_in
from hil.diagnosis.detection.score_test import ScoreTest, undetectable_effects
from hil.diagnosis.detection.shortlist import fit_shortlist, merge_best
from hil.diagnosis.detection.significance import eliminate_backward, is_significant, is_significant_given, with_gain
from hil.diagnosis.detection.single_cause import try_single_cause
from hil.diagnosis.detection.threshold import DetectionThreshold, local_discrepancy_factors
from hil.diagnosis.estimation.aliases import resolve_aliases
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO, Fitter, Model
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.spec import Vehicle

_NEAR = 0.2
"""Share of what the best explains, by one step or fitted, below which no other is fitted from the car as handed in, nor
the best at another place."""
RESTART_SHARE = 1.0 / 3.0
"""Share of what a cause explains, by which the fit without any must have been worse than it can be, for the search to
begin again from a better one."""
_LED_ANEW = 3
"""Leaders that get sensitivities of their own, when they are fitted from the car as handed in."""
Accepted = tuple[Model, Noise, list[FittedHypothesis]]
"""A model with one cause more, the noise beside it, and all that were fitted in its place, best first."""


def diagnose(
    case: Dataset, vehicle: Vehicle, base: ParameterSet, settings: Settings | None = None, say: Progress | None = None
) -> Diagnosis:
    """Diagnose a case; see the module."""
    return StepwiseSelection(case, vehicle, base, settings or Settings(), say or (lambda _: None)).run()


class StepwiseSelection:
    def __init__(self, case: Dataset, vehicle: Vehicle, base: ParameterSet, settings: Settings, say: Progress) -> None:
        self.settings, self.say = settings, say
        self.rig = Simulator(case, vehicle).denoised(base)
        self.frame = SampleMasks.of(self.rig.dataset)
        say("replaying the car as handed in")
        self.numbers = NuisanceFit(self.rig, self.frame, vehicle, base, settings.relinearise)
        self.unlisted = NonparametricSearch(self.numbers, settings, say)
        self.effective_parameters = float(len(self.numbers.nuisances))
        self.began_again = False

    @property
    def fitter(self) -> Fitter:
        """With the sensitivities to the vehicle's numbers last taken."""
        return self.numbers.fitter

    def run(self) -> Diagnosis:
        """All of it."""
        self.handed_in = self.fitter
        nominal, noise = self.fitter.start(self.settings.noise_model)
        self.say("noise, and the vehicle's numbers within their tolerance")
        model, noise = self.numbers.fit(nominal, noise)
        if self.rig.fit_hot_spot_phase(self.fitter.parameter_set(model.z, ())):
            model, noise = self.numbers.fit(self.fitter.at(model.z, (), noise), noise)
        quiet = unexcited_sensors(
            self.fitter.tracks(model.channels or self.rig.run(self.fitter.parameter_set(model.z, ()))), noise
        )
        self.field = CandidateSet(self.rig, self.frame, self.rig.vehicle.undiagnosable_effects, quiet)
        found = Diagnosis(self.rig.dataset, self.rig.vehicle, self.fitter, noise, noise, nominal, model, model)
        self._screened(found)
        around = model.z
        while causes_in(model) < self.settings.most_causes:
            accepted = self.select_next(found, model, noise)
            if accepted is None:
                break
            before, (model, noise, list_of) = len(model.terms), accepted
            if not list_of:
                model, noise = self._again(found, model, noise)
                around = model.z
                continue
            found.hypotheses += [list_of] * (len(model.terms) - before)
            model, noise = self._one_for_all(found, model, noise)
            self.say(f"accepted {model.terms[-1].candidate.name} = {model.terms[-1].value:.4g}; when it begins")
            model = estimate_onsets(self.fitter, model, noise)
            model = self._quieter(model, noise)
            model, noise, around = self.relinearise_if_stale(model, noise, around)
            bent, model = model, resolve_aliases(model, self.numbers.nuisances, self.fitter.base)
            around = around + model.z - bent.z
        if model.terms:
            bare = found.fitter
            found.final, found.noise, found.fitter = model, noise, self.fitter
            eliminate_backward(found, bare, self.effective_parameters, self.say)
        for term in filter(at_bound, found.final.terms):
            told = f"{term.candidate.name} = {term.value:.3g}"
            found.remarks.append(f"{told} is the end of its range: the true value may lie beyond")
        return found

    def _screened(self, found: Diagnosis) -> None:
        """What each candidate explains where the numbers alone explain all they can, and so what is asked of one."""
        self.say(f"sensitivities of {len(self.field.candidates)} candidates")
        self._shown_at(found.base)
        self.effective_parameters = self.fitter.effective_parameters(found.first_noise)
        found.information = self.fitter.information_blocks(found.base, self.field.jacobian, found.first_noise)
        found.scores = self.field.scores(self.fitter, found.information, found.base, found.first_noise)
        found.undetectable_effects = sorted(
            {*undetectable_effects(found.scores), *self.rig.vehicle.undiagnosable_effects}
        )
        self.asked = DetectionThreshold(found, self.field, self.settings.alpha)
        self.asked.update_inflation(self.fitter, found.scores, found.information, found.base)

    def _shown_at(self, model: Model) -> None:
        """What candidates, and laws in no list, show is that at this model."""
        self.field.linearise_at(self.fitter, model)
        self.unlisted.invalidate()

    def _again(self, found: Diagnosis, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """From numbers with which the causes of a model, or none, explain more than those the search went on from."""
        self.say("once more, from numbers that explain more")
        self.numbers.relinearise(model.z, model.terms)
        model, noise = self.numbers.fit(self.fitter.at(model.z, model.terms, noise), noise)
        if model.terms:
            self._shown_at(model)
        else:
            found.fitter, found.noise, found.first_noise = self.fitter, noise, noise
            found.base = found.final = model
            self._screened(found)
        return model, noise

    def nuisances_may_be_biased(self, model: Model) -> bool:
        """Whether something may have bent the vehicle's numbers."""
        return self.settings.relinearise and not model.terms and self.fitter.birge_ratio(model.z) >= BIASED_BIRGE_RATIO

    def _from_handed_in(
        self, model: Model, fitted: Sequence[FittedHypothesis], with_fit: RefitHypothesis, reference: float, anew: int,
        best: float = np.inf,
    ) -> tuple[list[FittedHypothesis], tuple[Model, Noise]]:  # fmt: skip
        """Contenders for a cause of a model fitted from the car as handed in, too; see there."""
        self.say("once more from the car as handed in")
        found, without = refit_from_nominal(self.numbers, fitted, model, with_fit, reference, anew, best)
        self.rig.denoise_inputs(self.fitter.parameter_set(model.z, model.terms))
        return found, without

    def _quieter(self, model: Model, noise: Noise) -> Model:
        """The model where what drives the car is made by it: a cause may move the steps of pressures and torques."""
        if not self.settings.relinearise:
            return model
        self.rig.denoise_inputs(self.fitter.parameter_set(model.z, model.terms))
        return self.fitter.fit(self.fitter.at(model.z, model.terms, noise), noise, 2)

    def relinearise_if_stale(self, model: Model, noise: Noise, around: Floats) -> tuple[Model, Noise, Floats]:
        """The model with sensitivities to the numbers taken anew where a cause let them go back far.

        Numbers that had stood in for the cause bend what all others seem to explain.
        """
        if not self.numbers.linearisation_stale(model, around):
            return model, noise, around
        self.say("sensitivities anew beside it")
        self.numbers.relinearise_cached(model.z, model.terms)
        model, noise = self.fitter.alternate_noise_and_fit(self.fitter.at(model.z, model.terms, noise), noise, 2)
        return model, noise, model.z

    def select_next(self, found: Diagnosis, model: Model, noise: Noise) -> Accepted | None:
        """The next cause, if one is beyond doubt; no contender where the numbers explain more without a further one."""
        left = FormErrorAllowance(found.explained, self.fitter, model, noise, self.field.jacobian)
        contest, top, fitted = self._leading(found, model, noise, left)
        error = local_discrepancy_factors(self.fitter, self.field, self.effective_parameters, found)
        reference, tighter = contest.reference, contest.noise

        def gained() -> list[FittedHypothesis]:
            best = min(fitted, key=criterion)
            return [with_gain(c, reference - left.of(c.term.candidate), error(c, best)) for c in fitted]

        if fitted and self.settings.relinearise:
            self.asked.update_inflation_at_fit(self.fitter, fitted)
            if self.nuisances_may_be_biased(model) or max(one.gain for one in gained()) >= found.detection_threshold:
                fitted, without = self._fitted_again(model, fitted, top, reference)
                bare = without[0].cost
                worse, more = reference - bare, bare - min(c.cost for c in fitted)
                if not self.began_again and worse > max(found.detection_threshold, RESTART_SHARE * more):
                    self.began_again = True
                    return *without, []
                reference = min(reference, bare)
            fitted = add_same_onset_alternatives(
                self.fitter, self.field, model, estimate_onsets_of_best(self.fitter, fitted)
            )
            self.asked.update_inflation_at_fit(self.fitter, fitted)
        elif fitted:
            fitted = estimate_onsets_of_best(self.fitter, fitted)
        listed = min(fitted, key=criterion, default=None)
        if listed is not None:
            tighter = listed.noise
            reference = min(reference, self.fitter.fit(model, tighter, 3).cost)
        fitted = gained() if fitted else []
        clear = sorted(
            (c for c in fitted if is_significant(c, found.detection_threshold, self.fitter, self.effective_parameters)),
            key=criterion,
        )
        now = SelectionStep(
            contest, model, tighter, reference, listed, bool(clear), left, error, self.nuisances_may_be_biased(model)
        )
        law = self.unlisted.best(found, now, self._from_handed_in)
        if law is not None:
            found.explained += reference - law.cost
            polished, tighter = self.fitter.alternate_noise_and_fit(law.model, law.noise, 1)
            return polished, tighter, [replace(law, model=polished, term=polished.terms[-1]), *clear]
        best = self.best_significant(fitted, clear, found.detection_threshold) if fitted else None
        if best is None:
            return None
        best, clear = self.refine_location(found, best, clear)
        found.explained += reference - best.cost
        polished = self.fitter.fit(best.model, best.noise, 4, self.settings.relinearise)
        polished, tighter = self.fitter.alternate_noise_and_fit(polished, best.noise, 2)
        rest = sorted(
            (c for c in {*fitted, *clear} if c is not best and (c in clear or criterion(c) >= criterion(best))),
            key=criterion,
        )
        return polished, tighter, [replace(best, model=polished, term=polished.terms[-1]), *rest]

    def _one_for_all(self, found: Diagnosis, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """The model, or one of a single cause that explains what all of its together do."""
        listed = all(not isinstance(term.candidate, BasisFunction) for term in model.terms)
        if not (self.settings.relinearise and listed and causes_in(model) > 1):
            return model, noise
        self.say("one cause instead of all")
        singles = try_single_cause(self.fitter, self.field, found, model, noise)
        if not singles:
            return model, noise
        found.hypotheses = [singles]
        found.explained += model.cost - singles[0].cost
        return self.fitter.alternate_noise_and_fit(singles[0].model, noise, 2)

    def _leading(
        self, found: Diagnosis, model: Model, noise: Noise, left: FormErrorAllowance
    ) -> tuple[CandidateFits, list[ScoreTest], list[FittedHypothesis]]:
        """The race for the next cause, its leaders and their fits; no leader where none can be beyond doubt."""
        listed, sums = self.field.scores_and_information(self.fitter, found, model, noise)
        if model.terms:
            self.asked.update_inflation(self.fitter, listed, sums, model)
        bent = self.nuisances_may_be_biased(model)
        plausible = self.field.shortlist(self.fitter, listed, sums, model, bent)
        contest = CandidateFits(self.fitter, self.field.jacobian, model, noise, self.settings.relinearise)
        leading = fit_shortlist(contest, plausible, left, found, bent, self.say)
        if bent:
            leading = merge_best(leading, self._leading_handed_in(found, noise, left))
        return contest, *leading

    def _leading_handed_in(
        self, found: Diagnosis, noise: Noise, left: FormErrorAllowance
    ) -> tuple[list[ScoreTest], list[FittedHypothesis]]:
        """Leaders as seen from the car as handed in, and their fits.

        Numbers that stand in for a cause leave nothing of it where they stand.
        """
        self.say("sensitivities at the car as handed in")
        fitter = self.handed_in
        nominal = fitter.at(np.zeros(len(self.numbers.nuisances)), (), noise)
        field = self.field.at(fitter, nominal)
        sums = fitter.information_blocks(nominal, field.jacobian, noise)
        listed = field.scores(fitter, sums, nominal, noise)
        plausible = field.shortlist(fitter, listed, sums, nominal, False)
        contest = CandidateFits(fitter, field.jacobian, nominal, noise, self.settings.relinearise)
        return fit_shortlist(contest, plausible, left, found, False, self.say)

    def _fitted_again(
        self, model: Model, fitted: list[FittedHypothesis], top: list[ScoreTest], reference: float
    ) -> tuple[list[FittedHypothesis], tuple[Model, Noise]]:
        """Contenders, those that explain much fitted from the car as handed in too, and the best fit without any."""
        explain = [max(item.raw_gain, reference - c.cost) for c, item in zip(fitted, top, strict=True)]
        least = 0.0 if self.nuisances_may_be_biased(model) else _NEAR * max(explain)
        near = [c for c, much in zip(fitted, explain, strict=True) if much >= least]
        refound, without = self._from_handed_in(model, near, refitted, reference, _LED_ANEW)
        better = dict(zip(map(id, near), refit_from_best(self.fitter, refound), strict=True))
        return [better.get(id(c), c) for c in fitted], without

    def best_significant(
        self, fitted: list[FittedHypothesis], clear: list[FittedHypothesis], least: float
    ) -> FittedHypothesis | None:
        """The best that is beyond doubt, beside one that explains more and is not, too."""
        if not clear:
            most = max(fitted, key=lambda c: c.gain)
            self.say(f"{most.term.candidate.name} gains {most.gain:.1f}, {least:.1f} is asked")
            return None
        better = min(fitted, key=criterion)
        how = (least, self.fitter, self.effective_parameters, self.settings.relinearise)
        best = next((c for c in clear if c is better or is_significant_given(c, better, *how)), None)
        if best is None:
            self.say(f"{better.term.candidate.name} explains more, and the model errs there; nothing stands beside it")
        return best

    def refine_location(
        self, found: Diagnosis, best: FittedHypothesis, clear: list[FittedHypothesis]
    ) -> tuple[FittedHypothesis, list[FittedHypothesis]]:
        """The best where it fits best: the screen knows the places only as well as the numbers stood."""
        name = candidate_key(best.term.candidate)
        like = [item for item in found.scores if candidate_key(item.candidate)[:2] == name[:2]]
        least = _NEAR * max((item.raw_gain for item in like if item.candidate is best.term.candidate), default=np.inf)
        places = [
            item.candidate for item in like if item.candidate is not best.term.candidate and item.raw_gain >= least
        ]
        if not self.settings.relinearise or not places:
            return best, clear
        self.say(f"{best.term.candidate.name} at other places")
        placed = [*clear, *refit_substitutes(self.fitter, best, [(place, best.term.value) for place in places], True)]
        better = [
            one
            for one in placed
            if candidate_key(one.term.candidate)[:2] == name[:2] and criterion(one) < criterion(best)
        ]
        return min(better, key=criterion, default=best), placed

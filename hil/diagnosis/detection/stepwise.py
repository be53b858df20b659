"""Stepwise selection of causes: forward, one at a time; backward elimination at the end.

Takes a dataset, a vehicle and its nominal parameter set; gives a `Diagnosis`. Noise and nuisance parameters are fitted
first. Each step tests all candidates, fits the best non-linearly and accepts one, restarts from better nuisance
parameters, or ends the selection (`hil.diagnosis.detection.forward_step`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.detection.candidates import CandidateSet, unexcited_sensors
from hil.diagnosis.detection.forward_step import Added, Done, ForwardStep, Restarted, Screening, State
from hil.diagnosis.detection.nonparametric import BasisFunction
from hil.diagnosis.detection.nonparametric_search import NonparametricSearch
from hil.diagnosis.detection.onset import estimate_onsets
from hil.diagnosis.detection.profile_fit import (
    FittedHypothesis,
    at_bound,
    criterion,
    refitted,
    unscored,
)
from hil.diagnosis.detection.reference_fit import Reference, doubted, fit_reference, since
from hil.diagnosis.detection.result import Diagnosis, Progress, Settings, causes_in, selections
from hil.diagnosis.detection.score_test import (
    OnsetTime,
    ScoreTest,
    effective_number_of_tests,
    inflation_given_best,
    onset_penalty,
    shortlist,
    undetectable_effects,
)
from hil.diagnosis.detection.significance import Elimination, eliminate_backward
from hil.diagnosis.detection.threshold import SHORTLIST_SIZE, DetectionThreshold
from hil.diagnosis.estimation.aliases import resolve_aliases
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.progress import expectation
from hil.diagnosis.simulation.hot_spots import has_hot_spots
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.spec import Vehicle
from hil.rt.clock import monotonic_ns


def diagnose(
    dataset: Dataset,
    vehicle: Vehicle,
    base: ParameterSet,
    settings: Settings | None = None,
    progress: Progress | None = None,
    reference: int = 0,
) -> Diagnosis:
    """Diagnose a dataset; ``base`` is the parameter set of the nominal vehicle.

    With a ``reference`` of so many recordings, the first ones, what has changed since is diagnosed.
    """
    settings, progress = settings or Settings(), progress or (lambda _: None)
    if not reference:
        return StepwiseSelection(dataset, vehicle, base, settings, progress).run()
    shown = fit_reference(dataset, vehicle, base, reference, settings, progress)
    return StepwiseSelection(dataset, vehicle, since(shown.base, reference), settings, progress, shown).run()


class StepwiseSelection:
    """The selection for one dataset; `run` reads as the whole of it.

    ``dataset`` has the inputs denoised at the first fit without causes, from `fit_nuisances` on.
    """

    dataset: Dataset

    def __init__(
        self, dataset: Dataset, vehicle: Vehicle, base: ParameterSet, settings: Settings, progress: Progress,
        reference: Reference | None = None,
    ) -> None:  # fmt: skip
        self.settings, self.progress, self.reference = settings, progress, reference
        simulator = Simulator(dataset, vehicle).prepared(base)
        self.vehicle, self.masks = vehicle, SampleMasks.of(simulator.dataset)
        progress("simulating the nominal vehicle")
        start_ns = monotonic_ns()
        self.nuisance_fit = self._nuisance_fit(simulator, base)
        progress(expectation(simulator.runs, monotonic_ns() - start_ns))
        self.nominal_fitter = self.fitter
        self.nominal, self.first_noise = self.fitter.start(settings.noise_model)

    def _nuisance_fit(self, simulator: Simulator, base: ParameterSet) -> NuisanceFit:
        relinearise, given = self.settings.relinearise, self.reference
        if given is None:
            return NuisanceFit(simulator, self.masks, self.vehicle, base, relinearise)
        return NuisanceFit(simulator, self.masks, self.vehicle, base, relinearise, given.nuisances, given.z)

    @property
    def fitter(self) -> Fitter:
        """With the last Jacobian of the nuisance parameters, and the simulator of the fits to come."""
        return self.nuisance_fit.fitter

    @fitter.setter
    def fitter(self, fitter: Fitter) -> None:
        self.nuisance_fit.fitter = fitter

    def run(self) -> Diagnosis:
        """Fit the nuisances, select causes forward, eliminate backward."""
        state = self.fit_nuisances()
        while causes_in(state.model) < self.settings.most_causes:
            outcome = self.select_next(state)
            state = replace(state, threshold=outcome.threshold)
            match outcome:
                case Added():
                    state = self.prefer_single_cause(state.with_cause(outcome))
                    state = self.estimate_onsets(state)
                    state = self.relinearise_if_stale(state)
                    state = self.resolve_aliases(state)
                case Restarted():
                    state = self.restart(state, outcome)
                case Done():
                    self.progress(outcome.reason)
                    break
        return self.eliminate_backward(state)

    # --- before the first step

    def fit_nuisances(self) -> State:
        """Fit noise and nuisance parameters; then `screen`."""
        self.progress("noise and nuisance parameters")
        model, noise = self.nuisance_fit.fit(self.nominal, self.first_noise)
        parameters = self.fitter.parameter_set(model.z, ())
        self.fitter = self.fitter.with_simulator(self.fitter.simulator.with_hot_spot_phase(parameters))
        if self.fitter.simulator.hot_spot_angles and has_hot_spots(parameters):
            model, noise = self.nuisance_fit.fit(self.fitter.at(model.z, (), noise), noise)
        simulator = self.fitter.simulator
        self.dataset = simulator.dataset
        unexcited = unexcited_sensors(self.fitter.tracks(self.fitter.channels(model)), noise)
        since_reference = self.reference is not None
        candidates = CandidateSet(
            simulator, self.masks, self.vehicle.undiagnosable_effects, unexcited, since_reference=since_reference
        )
        if self.reference is not None:
            model, noise = self._with_common_parts(candidates, self.reference, model, noise)
        return self.screen(candidates, model, noise)

    def _with_common_parts(
        self, candidates: CandidateSet, reference: Reference, model: Model, noise: Noise
    ) -> tuple[Model, Noise]:
        """The model with a common part of each change that may be taken for one, fitted anew."""
        self.fitter = self.fitter.at_baseline(model)
        candidates = candidates.at(self.fitter, model)
        blocks = self.fitter.information_blocks(model, candidates.jacobian, noise)
        more = reference.with_common_parts(doubted(candidates.scores(self.fitter, blocks, model, noise)))
        added = len(more.z) - len(reference.z)
        if not added:
            return model, noise
        self.progress(f"{added} common parts of what may have changed")
        self.reference = more
        self.nuisance_fit = self._nuisance_fit(self.fitter.simulator, self.fitter.base)
        self.nominal_fitter = self.fitter
        self.nominal, _ = self.fitter.start(self.settings.noise_model)
        start = self.fitter.at(np.append(model.z, np.zeros(added)), (), noise)
        return self.nuisance_fit.fit(start, noise)

    def screen(self, candidates: CandidateSet, model: Model, noise: Noise, restarted: bool = False) -> State:
        """Test each candidate at a model without causes; that sets the threshold."""
        candidates, nonparametric = self._linearised(candidates, model)
        effective_parameters = self.fitter.effective_parameters(noise)
        blocks = self.fitter.information_blocks(model, candidates.jacobian, noise)
        scores = candidates.scores(self.fitter, blocks, model, noise)
        threshold = DetectionThreshold(effective_number_of_tests(scores), self.settings.alpha)
        threshold = threshold.lowered(inflation_given_best(scores, blocks, self.fitter, model))
        screening = Screening(self.fitter, model, noise, effective_parameters, blocks, scores)
        return State(screening, candidates, nonparametric, threshold, model, noise, model.z, restarted=restarted)

    def _linearised(self, candidates: CandidateSet, model: Model) -> tuple[CandidateSet, NonparametricSearch]:
        """Candidates and nonparametric terms with their Jacobian at a model, which is the baseline from now on."""
        self.progress(f"Jacobian of {len(candidates.candidates)} candidates")
        self.fitter = self.fitter.at_baseline(model)
        search = NonparametricSearch(candidates.candidates, self.settings, self.progress)
        return candidates.at(self.fitter, model, self.progress), search

    def select_next(self, state: State) -> Added | Restarted | Done:
        """One step of the selection."""
        return ForwardStep(state, self.nuisance_fit, self.nominal_fitter, self.settings, self.progress).select()

    # --- after a step

    def prefer_single_cause(self, state: State) -> State:
        """With one cause in place of all, where that has the better criterion."""
        listed = all(not isinstance(term.candidate, BasisFunction) for term in state.model.terms)
        if not (self.settings.relinearise and listed and causes_in(state.model) > 1):
            return state
        self.progress("one cause in place of all")
        accepted = [hypotheses[0] for hypotheses in selections(state.hypotheses)]
        singles, self.fitter = try_single_cause(self.fitter, state.candidates, accepted, state.model, state.noise)
        if not singles:
            return state
        explained = state.explained + (state.model.cost - singles[0].cost)
        model, noise = self.fitter.alternate_noise_and_fit(singles[0].model, state.noise, 2)
        return replace(state, model=model, noise=noise, hypotheses=(singles,), explained=explained)

    def estimate_onsets(self, state: State) -> State:
        """With an onset for causes that have one, and the inputs denoised by the car with them."""
        term = state.model.terms[-1]
        self.progress(f"accepted {term.candidate.name} = {term.value:.4g}; estimating its onset")
        model, self.fitter = estimate_onsets(self.fitter, state.model, state.noise)
        if self.settings.relinearise:  # a cause may move the steps of pressures and torques
            self.fitter = self.fitter.denoised(model)
            model = self.fitter.fit(self.fitter.at(model.z, model.terms, state.noise), state.noise, 2)
        return replace(state, model=model)

    def relinearise_if_stale(self, state: State) -> State:
        """With a new Jacobian where a cause released nuisance parameters: the old one biases all other candidates."""
        model, noise = state.model, state.noise
        if not self.nuisance_fit.linearisation_stale(model, state.linearised_at):
            return state
        self.progress("new Jacobian given the causes")
        self.nuisance_fit.relinearise_cached(model.z, model.terms)
        model, noise = self.fitter.alternate_noise_and_fit(self.fitter.at(model.z, model.terms, noise), noise, 2)
        return replace(state, model=model, noise=noise, linearised_at=model.z)

    def resolve_aliases(self, state: State) -> State:
        """With the most probable share of each cause in the nuisance parameter that is the same quantity."""
        model = resolve_aliases(state.model, self.nuisance_fit.nuisances, self.fitter.base)
        return replace(state, model=model, linearised_at=state.linearised_at + model.z - state.model.z)

    def restart(self, state: State, restarted: Restarted) -> State:
        """From nuisance parameters with which the same causes, or none, explain more."""
        self.progress("restarting from nuisance parameters that explain more")
        model, noise = restarted.model, restarted.noise
        self.nuisance_fit.relinearise(model.z, model.terms)
        model, noise = self.nuisance_fit.fit(self.fitter.at(model.z, model.terms, noise), noise)
        if not model.terms:
            return self.screen(state.candidates, model, noise, restarted=True)
        candidates, nonparametric = self._linearised(state.candidates, model)
        return replace(
            state,
            candidates=candidates,
            nonparametric=nonparametric,
            model=model,
            noise=noise,
            linearised_at=model.z,
            restarted=True,
        )

    # --- after the last step

    def eliminate_backward(self, state: State) -> Diagnosis:
        """Take out the causes that are not needed; the result."""
        first, model, noise, fitter = state.screening, state.model, state.noise, self.fitter
        left = Elimination(model, state.hypotheses)
        if model.terms:
            left = eliminate_backward(
                fitter, model, noise, state.hypotheses, state.threshold, first.effective_parameters, self.progress
            )
            if not left.model.terms:
                fitter = first.fitter.denoised(first.model)
        final = left.model
        if not final.terms:
            final, noise = first.model, first.noise
        bounded = [f"{term.candidate.name} = {term.value:.3g}" for term in final.terms if at_bound(term)]
        return Diagnosis(
            dataset=self.dataset,
            vehicle=self.vehicle,
            fitter=fitter,
            noise=noise,
            first_noise=first.noise,
            nominal=self.nominal,
            base=first.model,
            final=final,
            hypotheses=left.hypotheses,
            scores=first.scores,
            undetectable_effects=sorted({*undetectable_effects(first.scores), *self.vehicle.undiagnosable_effects}),
            information=first.information,
            detection_threshold=state.threshold.gain,
            reference=0 if self.reference is None else self.reference.recordings,
            remarks=(*left.remarks, *(f"{text} is at its bound: the true value may lie beyond" for text in bounded)),
        )


def try_single_cause(
    fitter: Fitter, candidates: CandidateSet, accepted: Sequence[FittedHypothesis], model: Model, noise: Noise
) -> tuple[list[FittedHypothesis], Fitter]:
    """Single causes fitted from the nuisance parameters of a model of several, best first; empty where all of the model
    together, the ``accepted``, have the better criterion. The fitter comes back with the baseline they are fitted from.

    A cause selected given biased nuisance parameters may be made of others: a drag of one wheel, which they had
    absorbed, was named as a steering offset and a radius of that wheel. Given those the nuisance parameters are right
    again, and what they hid shows.
    """
    bare = fitter.at(model.z, (), noise)
    onsets: list[OnsetTime | None] = list(dict.fromkeys(term.onset for term in model.terms))
    if None in onsets:
        fitter = fitter.at_baseline(bare)
    tried = [(item, onset) for onset in onsets for item in _shortlist(fitter, candidates, bare, noise, onset)]

    def fitted(item: ScoreTest, onset: OnsetTime | None) -> FittedHypothesis:
        term = Term(item.candidate, item.value, onset)
        single = fitter.fit(fitter.at(model.z, (term,), noise), noise, 3)
        penalty = 0.0 if onset is None else onset_penalty(fitter.masks)
        return refitted(unscored(single, noise, item.information, penalty), single, noise)

    singles = sorted(thread_map(lambda one: fitted(*one), tried), key=criterion)
    together = model.cost + sum(one.total_penalty - 2.0 * one.log_occam_factor for one in accepted)
    return (singles if singles and criterion(singles[0]) < together else []), fitter


def _shortlist(
    fitter: Fitter, candidates: CandidateSet, bare: Model, noise: Noise, onset: OnsetTime | None
) -> list[ScoreTest]:
    if onset is not None:
        return shortlist(candidates.scores_from_onset(fitter, bare, noise, onset), SHORTLIST_SIZE)
    blocks = fitter.information_blocks(bare, candidates.jacobian, noise)
    return shortlist(candidates.scores(fitter, blocks, bare, noise, search=False), SHORTLIST_SIZE)

"""The car as reference logs show it: what the vehicle set, and the plant's equations, get wrong of it.

Takes a dataset whose first recordings are the reference; gives its nuisance parameters, those listed effects and
nonparametric terms included that the reference shows, or that a change might be taken for. Each of these has a *common*
part, which acts in all recordings, beside the *change* that is looked for, which acts from the first other recording
on. What both share is no change: it moves the common part alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.dataset import Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.candidates import CandidateSet
from hil.diagnosis.detection.group_score_test import STEP_SHARE, GroupScoreTest
from hil.diagnosis.detection.nonparametric import BasisExpansion
from hil.diagnosis.detection.result import Progress, Settings
from hil.diagnosis.detection.score_test import ScoreTest, score, shortlist
from hil.diagnosis.detection.threshold import SHORTLIST_MIN_GAIN
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.information import marginalise
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.estimation.terms import Candidate, summed
from hil.diagnosis.noise.model import Noise, SampleMasks
from hil.diagnosis.simulation.parameter_set import Change, ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind, of_the_day
from hil.diagnosis.vehicle.spec import Vehicle
from plant.injection.theta import THETA

_MOST_LEARNED = 12
"""Listed effects that one round learns from the reference, at most: six numbers of an unknown car take eight."""
_ROUNDS = 2
"""Rounds of learning: the second sees what the first had hidden, and what its linear steps missed."""
_MOST_DOUBTED = 12
"""Changes with the largest scores that get a common part each, besides half as many by gain and other locations."""


_LEAST_CURVE_GAIN = 20.0
"""Gain in chi-squared from which on the best nonparametric term is learned: that of `SHORTLIST_MIN_GAIN` for each
coefficient, which noise exceeds once in 800 (five degrees of freedom). One alone: each slows every simulation."""


@dataclass(frozen=True, eq=False)
class Reference:
    """What the reference says.

    Attributes
    ----------
    recordings : how many of the dataset, its first ones, are the reference.
    base : the nominal vehicle, with the rows of common nonparametric terms.
    nuisances : of the whole dataset, common ones first.  z : (nuisances,) as the reference shows them, in prior sds.
    """

    recordings: int
    base: ParameterSet
    nuisances: tuple[Nuisance, ...]
    z: Floats

    def with_common_parts(self, candidates: Sequence[Candidate]) -> "Reference":
        """With a common part of each of these that has none yet."""
        _, added = common_parts(self.base, self.nuisances, candidates, ())
        return replace(self, nuisances=(*self.nuisances, *added), z=np.append(self.z, np.zeros(len(added))))


def common_part(candidate: Candidate) -> Nuisance:
    """A candidate as a nuisance parameter that acts in all recordings; any value of it is allowed."""
    start = THETA.slice(candidate.effect.name, candidate.parameter.name).start
    at, sd = tuple(start + member for member in candidate.members()), candidate.prior_sd
    low, high = candidate.parameter.low / sd, candidate.parameter.high / sd
    return Nuisance(
        candidate.name, at, (sd,) * len(at), NuisanceKind.LEARNED, max(-low, high), high, low,
        difference=abs(candidate.parameter.step) / sd,
    )  # fmt: skip


def common_parts(
    base: ParameterSet, known: Sequence[Nuisance], candidates: Sequence[Candidate], curves: Sequence[BasisExpansion]
) -> tuple[ParameterSet, list[Nuisance]]:
    """Common parts of candidates and nonparametric terms not ``known`` yet; the vehicle with rows of the latter."""
    names = {one.name for one in known}
    added = [one for one in map(common_part, candidates) if one.name not in names]
    rows = base.nonparametric_rows
    for function in (one for curve in curves for one in curve.functions):
        if function.name in names:
            continue
        none, unit, typical = function.row(0.0), function.row(1.0), function.term.typical
        at = tuple((rows.size + np.flatnonzero(unit != none)).tolist())
        bound = function.parameter.high / typical
        kind = NuisanceKind.LEARNED_CURVE
        added.append(Nuisance(function.name, at, (typical,) * len(at), kind, bound, difference=STEP_SHARE))
        rows = np.vstack([rows, none])
    return replace(base, nonparametric_rows=rows), added


def since(base: ParameterSet, recordings: int) -> ParameterSet:
    """A parameter set that may change after so many recordings."""
    return replace(base, change=Change(recordings))


def fit_reference(
    dataset: Dataset, vehicle: Vehicle, base: ParameterSet, recordings: int, settings: Settings, progress: Progress
) -> Reference:
    """Fit the nuisance parameters to the first ``recordings``, with the listed effects that these show."""
    progress("the reference: noise and nuisance parameters")
    alone = replace(dataset, recordings=dataset.recordings[:recordings])
    simulator = Simulator(alone, vehicle).prepared(base)
    masks = SampleMasks.of(simulator.dataset)
    fit = NuisanceFit(simulator, masks, vehicle, base, settings.relinearise)
    model, noise = fit.fit(*fit.fitter.start(settings.noise_model))
    for turn in range(_ROUNDS + 1):
        shown: list[Candidate] = []
        curves: list[BasisExpansion] = []
        if turn < _ROUNDS:
            candidates = CandidateSet(fit.fitter.simulator, masks, vehicle.undiagnosable_effects)
            progress(f"the reference: Jacobian of {len(candidates.candidates)} candidates")
            shown = _shown(fit.fitter.at_baseline(model), model, noise, candidates)
        elif settings.dictionary:
            progress("the reference: simulating nonparametric terms")
            curves = _curves_shown(fit.fitter, model, noise)
        base, added = common_parts(base, fit.nuisances, shown, curves)
        if not added:
            continue
        progress(f"the reference shows {', '.join([one.name for one in shown] + [one.name for one in curves])}")
        z = np.append(model.z, np.zeros(len(added)))
        fit = NuisanceFit(simulator, masks, vehicle, base, settings.relinearise, (*fit.nuisances, *added), z)
        model, noise = fit.fit(fit.fitter.at(z, (), noise), noise)
    others = dataset.recordings[recordings:]
    measured = all(one.log.disc_temperature_k is not None for one in (*alone.recordings, *others))
    days = of_the_day(vehicle.nuisances, base.p, measured)
    return Reference(recordings, base, (*fit.nuisances, *days), np.append(model.z, np.zeros(len(days))))


def _shown(fitter: Fitter, model: Model, noise: Noise, candidates: CandidateSet) -> list[Candidate]:
    """Candidates without a common part that explain the residual one after the other, all before marginalised."""
    candidates, known = candidates.at(fitter, model), {one.name for one in fitter.nuisances}
    listed = [one for one in candidates.candidates if not one.effect.free_phase and one.name not in known]
    blocks = fitter.information_blocks(model, candidates.jacobian, noise)
    marginal = marginalise(blocks.total(), blocks.nuisances, (), model.z, fitter.at_bounds(model.z))
    q = summed(marginal.q, listed)
    b = np.array([float(marginal.b[list(one.columns)].sum()) for one in listed])
    prior = np.array([one.prior_sd**-2.0 for one in listed])
    chosen: list[int] = []
    while len(chosen) < _MOST_LEARNED:
        best = max(_tests(listed, b, q, prior, chosen), key=lambda item: item.log_bayes_factor, default=None)
        if best is None or best.raw_gain < SHORTLIST_MIN_GAIN:
            break
        chosen.append(listed.index(best.candidate))
    return [listed[k] for k in chosen]


def _tests(listed: Sequence[Candidate], b: Floats, q: Floats, prior: Floats, chosen: Sequence[int]) -> list[ScoreTest]:
    """Score tests of all but those chosen, which are marginalised; what needs more than noise to show has none."""
    at = list(chosen)
    if at:
        solved = np.linalg.solve(q[np.ix_(at, at)] + np.diag(prior[at]), np.column_stack([b[at], q[at]]))
        b, q = b - q[:, at] @ solved[:, 0], q - q[:, at] @ solved[:, 1:]
    tests = [score(one, float(b[k]), float(q[k, k])) for k, one in enumerate(listed) if k not in at]
    return [item for item in tests if item.raw_gain >= SHORTLIST_MIN_GAIN]


def _curves_shown(fitter: Fitter, model: Model, noise: Noise) -> list[BasisExpansion]:
    """The nonparametric term that the data show most clearly; empty where they show none."""
    fitter = fitter.at_baseline(model)
    scores, _ = GroupScoreTest(fitter, fitter.parameter_set(model.z, model.terms)).scores(fitter, model, noise)
    return [entry.expansion for entry in scores[:1] if entry.gain >= _LEAST_CURVE_GAIN]


def doubted(tests: Sequence[ScoreTest]) -> list[Candidate]:
    """Candidates whose change the scores favour most: what each of them has in common with the reference counts."""
    return [item.candidate for item in shortlist(tests, _MOST_DOUBTED)]

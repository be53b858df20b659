"""Hypotheses fitted from the nominal vehicle, too: causes that nuisance parameters absorbed.

Nuisance parameters that absorbed a cause leave little of it, and another cause fits the rest better; from there a fit
does not find back. Takes fitted hypotheses; gives each with the better of both fits, and the best fit without any.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion
from hil.diagnosis.detection.threshold import (
    AS_GOOD_SHARE,
    FIRST_REFITTED,
    OVERTAKING_CRITERION,
    RIVAL_SHARE,
)
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO
from hil.diagnosis.estimation.model import Model
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.progress import Progress

_ROUNDS = 3
RefitHypothesis = Callable[[FittedHypothesis, Model, Noise], FittedHypothesis]
"""Gives a hypothesis with another fit, its last terms being the cause."""
Refits = tuple[list[FittedHypothesis], tuple[Model, Noise]]
"""Hypotheses with the better of two fits each; the best model without any, and its noise."""


def refit_from_nominal(
    nuisance_fit: NuisanceFit, fitted: Sequence[FittedHypothesis], given: Model, refit: RefitHypothesis,
    reference: float, relinearised: int, rival_criterion: float = np.inf, progress: Progress | None = None,
) -> Refits:  # fmt: skip
    """Fit the hypotheses from the nominal vehicle, and the model without any from where the best of them end.

    Parameters
    ----------
    given : the model that each of them extends, with cost ``reference``.
    relinearised : at least one: so many of the best get Jacobians of their own, where their nuisance parameters are far
        from those of the last Jacobian.
    rival_criterion : of the best among other hypotheses; a fit that stays far behind is not continued.
    """
    fits = _NominalFits(nuisance_fit, given, refit, reference, progress)
    order = sorted(range(len(fitted)), key=lambda k: criterion(fitted[k]))
    first, rest, best = order[:FIRST_REFITTED], order[FIRST_REFITTED:], rival_criterion
    refits = dict(zip(first, fits.from_nominal([fitted[k] for k in first], best), strict=True))
    best = min(best, *map(criterion, refits.values()))
    refits |= dict(zip(rest, fits.from_nominal([fitted[k] for k in rest], best), strict=True))
    leading = sorted(order, key=lambda k: criterion(refits[k]))[:relinearised]
    best = min(best, criterion(refits[leading[0]]))
    last_fitter, without = nuisance_fit.fitter, []
    for k in leading:
        far = fits.needs_jacobian(refits[k], best)
        if k == leading[0] or far:
            model, noise = refits[k].model, refits[k].noise
            if far:
                model, noise = fits.relinearised(refits[k])
                refits[k] = min(refits[k], refit(refits[k], model, noise), key=criterion)
            without.append(fits.without(model, noise))
    nuisance_fit.fitter = last_fitter
    return [refits[k] for k in range(len(fitted))], min(without, key=lambda fit: fit[0].cost)


class _NominalFits:
    """The fits of `refit_from_nominal`; ``linearised_at`` are the nuisance parameters of the last Jacobian."""

    def __init__(
        self, nuisance_fit: NuisanceFit, given: Model, refit: RefitHypothesis, reference: float,
        progress: Progress | None,
    ) -> None:  # fmt: skip
        self._progress = progress
        self._nuisance_fit, self._given, self._refit, self._reference = nuisance_fit, given, refit, reference
        self._fitter, self._linearised_at = nuisance_fit.fitter, given.z

    def from_nominal(self, fitted: Sequence[FittedHypothesis], best: float) -> list[FittedHypothesis]:
        """Each hypothesis from the nominal vehicle, where that is better; ``best`` is the best criterion so far."""
        return thread_map(lambda one: self._from_nominal(one, best), fitted, "fits from nominal", self._progress)

    def _from_nominal(self, one: FittedHypothesis, best: float) -> FittedHypothesis:
        own, noise = self._fitter.copy(), one.noise
        model = own.at(own.origin, one.model.terms, noise)
        model = own.fit(model, noise, 4, follow=True)
        start = self._refit(one, model, noise)
        if not self._biased(one.model.z) and start.cost >= one.cost:
            return one  # unbiased nuisance parameters are reached from either side
        if not self._near(start, best, RIVAL_SHARE):
            return min(one, start, key=criterion)
        for _ in range(_ROUNDS - 1):
            noise = own.estimate_noise(model, noise)
            model = own.fit(model, noise, 4, follow=True)
        noise = own.estimate_noise(model, noise)
        return min(one, self._refit(one, own.fit(model, noise, 2), noise), key=criterion)

    def _near(self, one: FittedHypothesis, best: float, share: float) -> bool:
        """Whether the criterion improves by this share of what the best does."""
        return criterion(one) <= self._reference - share * max(self._reference - best, 0.0)

    def _biased(self, z: Floats) -> bool:
        return self._fitter.birge_ratio(z) >= BIASED_BIRGE_RATIO

    def needs_jacobian(self, one: FittedHypothesis, best: float) -> bool:
        """Whether the last Jacobian may hide that it is the best: its nuisance parameters are biased or far away."""
        if self._biased(one.model.z):
            return self._near(one, best, RIVAL_SHARE)
        as_good = self._near(one, best, AS_GOOD_SHARE) and criterion(one) - best < OVERTAKING_CRITERION
        return as_good and self._nuisance_fit.linearisation_stale(one.model, self._linearised_at)

    def relinearised(self, one: FittedHypothesis) -> tuple[Model, Noise]:
        """The model of a hypothesis fitted with a Jacobian of its own."""
        model, noise = one.model, one.noise
        self._nuisance_fit.relinearise(model.z, model.terms)
        start, self._linearised_at = self._nuisance_fit.fitter.at(model.z, model.terms, noise), model.z
        if self._biased(model.z):
            return self._nuisance_fit.fit(start, noise)
        return self._nuisance_fit.fitter.alternate_noise_and_fit(start, noise, 2)

    def without(self, model: Model, noise: Noise) -> tuple[Model, Noise]:
        """The model that the hypotheses extend, fitted from where one of them ended."""
        fitter = self._nuisance_fit.fitter
        start = fitter.fit(fitter.at(model.z, self._given.terms, noise), noise, 6)
        return fitter.alternate_noise_and_fit(start, noise, 2)

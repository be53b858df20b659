"""Causes that the vehicle's numbers stood in for: fitted from the car as handed in, too.

Numbers that went far leave little of a cause that acts alike, and another one fits what they leave better. From where
they stand a fit does not find back.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.detection.profile_fit import FittedHypothesis, criterion
from hil.diagnosis.estimation.gauss_newton import BIASED_BIRGE_RATIO, Model
from hil.diagnosis.estimation.nuisance_fit import NuisanceFit
from hil.diagnosis.noise.model import Noise
from hil.diagnosis.parallel import thread_map

_ROUNDS = 3
_RIVAL, _AS_GOOD = 1.0 / 3.0, 0.9
"""Shares of what the best explains: below the one, numbers that went far hide no rival; below the other, sensitivities
taken anew make none of a cause beside which they did not."""
_OVERTAKES = 25.0
"""By how much in odds sensitivities taken anew let one overtake another (they gave 0.4 to 20; docs/decisions/0086)."""
_FIRST = 2
"""How many of the best are fitted before the others, which go on while they explain a third of what those do."""
RefitHypothesis = Callable[[FittedHypothesis, Model, Noise], FittedHypothesis]


def refit_from_nominal(
    numbers: NuisanceFit, fitted: Sequence[FittedHypothesis], beside: Model, refitted: RefitHypothesis, reference: float, anew: int,
    best: float = np.inf,
) -> tuple[list[FittedHypothesis], tuple[Model, Noise]]:  # fmt: skip
    """The same contenders, each fitted from the car as handed in where that explains more; the best fit without any.

    What takes less than a third as much off the ``reference`` as the very best (or others, whose odds are ``best``) is
    not followed to its end. So many of the others (one or more) get sensitivities ``anew`` where their numbers are far
    from where they were last taken, at first those of the model that is ``beside`` them. With those the numbers are
    fitted without them, too. ``refitted`` gives a contender with another model and noise.
    """
    fitter = numbers.fitter

    def near(one: FittedHypothesis, best: float, share: float = _RIVAL) -> bool:
        return criterion(one) <= reference - share * max(reference - best, 0.0)

    def again(one: FittedHypothesis, best: float) -> FittedHypothesis:
        own, noise = fitter.copy(), one.noise
        model = own.at(np.zeros(len(numbers.nuisances)), one.model.terms, noise)
        model = own.fit(model, noise, 4, follow=True)
        begun = refitted(one, model, noise)
        if fitter.birge_ratio(one.model.z) < BIASED_BIRGE_RATIO and begun.cost >= one.cost:
            return one  # numbers that are not bent are found from either side
        if not near(begun, best):
            return min(one, begun, key=criterion)
        for _ in range(_ROUNDS - 1):
            noise = own.estimate_noise(model, noise)
            model = own.fit(model, noise, 4, follow=True)
        noise = own.estimate_noise(model, noise)
        return min(one, refitted(one, own.fit(model, noise, 2), noise), key=criterion)

    order = sorted(range(len(fitted)), key=lambda k: criterion(fitted[k]))
    found = dict(zip(order, thread_map(lambda k: again(fitted[k], best), order[:_FIRST]), strict=False))
    best = min(best, *map(criterion, found.values()))
    rest = order[_FIRST:]
    found |= dict(zip(rest, thread_map(lambda k: again(fitted[k], best), rest), strict=True))
    leading = sorted(order, key=lambda k: criterion(found[k]))[:anew]
    best, bare, around = min(best, criterion(found[leading[0]])), [], beside.z
    for k in leading:
        one = found[k]
        bent = fitter.birge_ratio(one.model.z) >= BIASED_BIRGE_RATIO
        as_good = near(one, best, _AS_GOOD) and criterion(one) - best < _OVERTAKES
        far = near(one, best) if bent else as_good and numbers.linearisation_stale(one.model, around)
        if k != leading[0] and not far:
            continue
        model, noise = one.model, one.noise
        if far:
            numbers.relinearise(model.z, model.terms)
            begun, around = numbers.fitter.at(model.z, model.terms, noise), model.z
            if bent:
                model, noise = numbers.fit(begun, noise)
            else:
                model, noise = numbers.fitter.alternate_noise_and_fit(begun, noise, 2)
            found[k] = min(one, refitted(one, model, noise), key=criterion)
        without = numbers.fitter.fit(numbers.fitter.at(model.z, beside.terms, noise), noise, 6)
        bare.append(numbers.fitter.alternate_noise_and_fit(without, noise, 2))
    numbers.fitter = fitter
    return [found[k] for k in range(len(fitted))], min(bare, key=lambda fit: fit[0].cost)

"""Causes that the vehicle's numbers stood in for: fitted from the car as handed in, too.

Numbers that went far leave little of a cause that acts alike, and another one fits what they leave better. From where
they stand a fit does not find back.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.detection.profile_fit import Contender, Contest, odds
from hil.diagnosis.estimation.gauss_newton import STRAINED, Model
from hil.diagnosis.estimation.nuisance_fit import Numbers
from hil.diagnosis.noise.model import Noise

_ROUNDS = 3
_RIVAL, _AS_GOOD = 1.0 / 3.0, 0.9
"""Shares of what the best explains: below the one, numbers that went far hide no rival; below the other, sensitivities
taken anew make none of a cause beside which they did not."""
_OVERTAKES = 25.0
"""By how much in odds sensitivities taken anew let one overtake another (they gave 0.4 to 20; docs/decisions/0086)."""
_FIRST = 2
"""How many of the best are fitted before the others, which go on while they explain a third of what those do."""
Refitted = Callable[[Contender, Model, Noise], Contender]


def from_handed_in(
    numbers: Numbers, fitted: Sequence[Contender], beside: Model, refitted: Refitted, reference: float, anew: int,
    best: float = np.inf,
) -> tuple[list[Contender], tuple[Model, Noise]]:  # fmt: skip
    """The same contenders, each fitted from the car as handed in where that explains more; the best fit without any.

    What takes less than a third as much off the ``reference`` as the very best (or others, whose odds are ``best``) is
    not followed to its end. So many of the others (one or more) get sensitivities ``anew`` where their numbers are far
    from where they were last taken, at first those of the model that is ``beside`` them. With those the numbers are
    fitted without them, too. ``refitted`` gives a contender with another model and noise.
    """
    fitter = numbers.fitter

    def near(one: Contender, best: float, share: float = _RIVAL) -> bool:
        return odds(one) <= reference - share * max(reference - best, 0.0)

    def again(one: Contender, best: float) -> Contender:
        own, noise = fitter.copied(), one.noise
        model = own.at(np.zeros(len(numbers.nuisances)), one.model.terms, noise)
        model = own.fit(model, noise, 4, follow=True)
        begun = refitted(one, model, noise)
        if fitter.strain(one.model.z) < STRAINED and begun.cost >= one.cost:
            return one  # numbers that are not bent are found from either side
        if not near(begun, best):
            return min(one, begun, key=odds)
        for _ in range(_ROUNDS - 1):
            noise = own.estimated(model, noise)
            model = own.fit(model, noise, 4, follow=True)
        noise = own.estimated(model, noise)
        return min(one, refitted(one, own.fit(model, noise, 2), noise), key=odds)

    order = sorted(range(len(fitted)), key=lambda k: odds(fitted[k]))
    found = dict(zip(order, Contest.at_once(lambda k: again(fitted[k], best), order[:_FIRST]), strict=False))
    best = min(best, *map(odds, found.values()))
    rest = order[_FIRST:]
    found |= dict(zip(rest, Contest.at_once(lambda k: again(fitted[k], best), rest), strict=True))
    leading = sorted(order, key=lambda k: odds(found[k]))[:anew]
    best, bare, around = min(best, odds(found[leading[0]])), [], beside.z
    for k in leading:
        one = found[k]
        bent = fitter.strain(one.model.z) >= STRAINED
        as_good = near(one, best, _AS_GOOD) and odds(one) - best < _OVERTAKES
        far = near(one, best) if bent else as_good and numbers.went_far(one.model, around)
        if k != leading[0] and not far:
            continue
        model, noise = one.model, one.noise
        if far:
            numbers.anew(model.z, model.terms)
            begun, around = numbers.fitter.at(model.z, model.terms, noise), model.z
            if bent:
                model, noise = numbers.fitted(begun, noise)
            else:
                model, noise = numbers.fitter.settle(begun, noise, 2)
            found[k] = min(one, refitted(one, model, noise), key=odds)
        without = numbers.fitter.fit(numbers.fitter.at(model.z, beside.terms, noise), noise, 6)
        bare.append(numbers.fitter.settle(without, noise, 2))
    numbers.fitter = fitter
    return [found[k] for k in range(len(fitted))], min(bare, key=lambda fit: fit[0].cost)

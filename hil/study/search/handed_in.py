"""Causes that the vehicle's numbers stood in for: fitted from the car as handed in, too.

Numbers that went far leave little of a cause that acts alike, and another one fits what they leave better. From where
they stand a fit does not find back.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hil.study.fitting.fit import Model
from hil.study.fitting.numbers import STRAINED, Numbers, strain
from hil.study.likelihood.noise import Noise
from hil.study.search.contest import Contender, Contest, odds

_ROUNDS, _RIVAL = 3, 1.0 / 3.0
Refitted = Callable[[Contender, Model, Noise], Contender]


def from_handed_in(
    numbers: Numbers, fitted: Sequence[Contender], beside: Model, refitted: Refitted, reference: float, anew: int
) -> tuple[list[Contender], tuple[Model, Noise]]:
    """The same contenders, each fitted from the car as handed in where that explains more; the best fit without any.

    So many of the best (one or more), if they take a third as much off the ``reference`` as the very best, get
    sensitivities ``anew`` where their numbers are far from those of the model that is ``beside`` them. With those the
    numbers are fitted without them, too. ``refitted`` gives a contender with another model and noise.
    """
    fitter = numbers.fitter

    def again(one: Contender) -> Contender:
        own, noise = fitter.copied(), one.noise
        model = own.at(np.zeros(len(numbers.nuisances)), one.model.terms, noise)
        for _ in range(_ROUNDS):
            model = own.fit(model, noise, 4, follow=True)
            if model.cost >= one.cost and strain(one.model.z) < STRAINED:
                return one  # numbers that are not bent are found from either side
            noise = own.estimated(model, noise)
        return min(one, refitted(one, own.fit(model, noise, 2), noise), key=odds)

    found, bare = Contest.at_once(again, fitted), []
    leading = sorted(range(len(found)), key=lambda k: odds(found[k]))[:anew]
    least = reference - _RIVAL * max(reference - odds(found[leading[0]]), 0.0)
    for k in leading:
        one = found[k]
        far = strain(one.model.z) >= STRAINED or numbers.went_far(one.model, beside.z)
        if k != leading[0] and not (far and odds(one) <= least):
            continue
        model, noise = one.model, one.noise
        if far:
            numbers.anew(model.z, model.terms)
            begun = numbers.fitter.at(model.z, model.terms, noise)
            if strain(begun.z) >= STRAINED:
                model, noise = numbers.fitted(begun, noise)
            else:
                model, noise = numbers.fitter.settle(begun, noise, 2)
            found[k] = min(one, refitted(one, model, noise), key=odds)
        without = numbers.fitter.fit(numbers.fitter.at(model.z, beside.terms, noise), noise, 6)
        bare.append(numbers.fitter.settle(without, noise, 2))
    numbers.fitter = fitter
    return found, min(bare, key=lambda fit: fit[0].cost)

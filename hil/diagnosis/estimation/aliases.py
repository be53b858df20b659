"""Causes that are a number of the vehicle: what of them is the number's tolerance, and what the cause.

A dead time that is 15 ms too long is the vehicle's dead time off by as much, and stamps of a node that are late are its
latency: no data tell the two apart, only what is stated. A fit ends anywhere on that line; here its most likely point
is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.gauss_newton import Model, Term
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.vehicle.priors import Nuisance
from plant.injection.apply import Q
from plant.injection.theta import THETA
from plant.vectors import OUTPUT, PARAMETER

_STAMPS = "timestamp_offset"
"""Of the stamps of a node, the same number as its latency."""


@dataclass(frozen=True)
class Alias:
    """The number of the vehicle that a cause is: which of the nuisances, where it lies, how much a unit of the cause
    moves it; whether it is a latency."""

    nuisance: int
    at: int
    slope: float
    latency: bool = False

    def of(self, world: ParameterSet) -> float:
        """The number in a world, without the cause."""
        return world.latency_s[self.at] if self.latency else float(world.p[self.at])

    def deviation(self, nuisances: Sequence[Nuisance]) -> float:
        """One standard deviation of the number, in units of the cause."""
        return abs(nuisances[self.nuisance].step[0] / self.slope)


def alias_of(term: Term, nuisances: Sequence[Nuisance], world: ParameterSet) -> Alias | None:
    """The number that the cause is in a world without it; None: it is none, or more than one."""
    if term.onset is not None:
        return None
    if term.candidate.effect.name == _STAMPS:
        late = (k for k, one in enumerate(nuisances) if one.name == f"late_{term.candidate.location}")
        return next((Alias(k, nuisances[k].at[0], 1.0, True) for k in late), None)
    if term.candidate.location != "car":
        return None
    step = 0.01 * term.candidate.parameter.typical
    moved = [_numbers(term, value, world) for value in (term.value, term.value - step)]
    if moved[0] is None or moved[1] is None:
        return None
    changed = np.flatnonzero(moved[0] != world.p).tolist()
    for k, nuisance in enumerate(nuisances):
        if nuisance.kind == "vehicle" and list(nuisance.at) == changed:
            slope = float(moved[0][changed[0]] - moved[1][changed[0]]) / step
            return Alias(k, changed[0], slope) if slope else None
    return None


def resolve_aliases(model: Model, nuisances: Sequence[Nuisance], base: ParameterSet) -> Model:
    """The same car with the most likely share of each cause in the number that it is; ``base`` is as handed in."""
    for number, term in enumerate(model.terms):
        same = alias_of(term, nuisances, base.with_nuisances(nuisances, model.z))
        if same is None:
            continue
        step, spread = nuisances[same.nuisance].step[0], term.candidate.prior_sd * same.slope
        wanted = _value(term, base.with_nuisances(nuisances, model.z), same)
        z = model.z.copy()
        z[same.nuisance] = (wanted - same.of(base)) * step / (step**2 + spread**2)
        without = base.with_nuisances(nuisances, z)
        parameter = term.candidate.parameter

        def off(
            value: float, term: Term = term, without: ParameterSet = without, same: Alias = same, wanted: float = wanted
        ) -> float:
            return _value(replace(term, value=value), without, same) - wanted

        if off(parameter.low) * off(parameter.high) >= 0.0:
            continue
        terms = list(model.terms)
        terms[number] = replace(term, value=float(brentq(off, parameter.low, parameter.high, xtol=1e-12)))
        cost = model.cost + float(z @ z - model.z @ model.z)
        model = replace(model, z=z, terms=tuple(terms), cost=cost)
    return model


def _value(term: Term, world: ParameterSet, same: Alias) -> float:
    """The number as the equations read it."""
    numbers = None if same.latency else _numbers(term, term.value, world)
    if numbers is None:
        return same.of(world) + (term.value if same.latency else 0.0)
    return float(numbers[same.at])


def _numbers(term: Term, value: float, world: ParameterSet) -> Floats | None:
    """Parameters as the equations read them with the cause; None where it is more than parameters."""
    effect = term.candidate.effect
    if effect.static is None or effect.dynamic is not None or effect.rates is not None or effect.sensing:
        return None
    q, y = np.zeros(Q.size), np.zeros(OUTPUT.size)
    q[: PARAMETER.size] = world.p
    theta = term.candidate.applied(replace(world, theta=THETA.neutral()), value).theta
    q[Q.slice("theta")] = theta
    first = Q.slice("theta").start + THETA.slice(effect.name, effect.parameters[0].name).start
    getattr(effect.static, "py_func", effect.static)(q, first, y)
    return None if y.any() else q[: PARAMETER.size]

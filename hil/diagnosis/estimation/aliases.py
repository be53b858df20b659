"""Aliases: terms that change the same parameter as a nuisance, and the most likely split between the two.

Takes a fitted model; gives the same car at its most likely point. A dead time that is 15 ms longer is the vehicle's own
dead time off by as much, and late time stamps of a node are its latency: no data separate the two, only their priors. A
fit ends anywhere on that line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.vehicle.priors import Nuisance, NuisanceKind
from plant.effects.effect import NODE_LATENCY
from plant.injection.apply import Q
from plant.injection.theta import THETA
from plant.vectors import OUTPUT, PARAMETER


@dataclass(frozen=True)
class Alias:
    """Nuisance that a term is an alias of: its index, the index ``at`` of its parameter, the ``slope`` of the parameter
    by the term's value, and whether the parameter is a latency."""

    nuisance: int
    at: int
    slope: float
    latency: bool = False

    def of(self, parameters: ParameterSet) -> float:
        """The parameter without the term."""
        return parameters.latency_s[self.at] if self.latency else float(parameters.p[self.at])

    def deviation(self, nuisances: Sequence[Nuisance]) -> float:
        """Prior standard deviation of the nuisance, in units of the term's value."""
        return abs(nuisances[self.nuisance].step[0] / self.slope)


def alias_of(term: Term, nuisances: Sequence[Nuisance], parameters: ParameterSet) -> Alias | None:
    """Alias of a term, given the parameter set without it; None where it is no or more than one parameter."""
    if term.onset is not None or parameters.change is not None:
        return None
    if NODE_LATENCY in term.candidate.parameter.aliases:
        late = (k for k, one in enumerate(nuisances) if one.name == f"late_{term.candidate.location}")
        return next((Alias(k, nuisances[k].at[0], 1.0, True) for k in late), None)
    if term.candidate.location != "car":
        return None
    step = 0.01 * term.candidate.parameter.typical
    moved = [_parameters_with(term, value, parameters) for value in (term.value, term.value - step)]
    if moved[0] is None or moved[1] is None:
        return None
    changed = np.flatnonzero(moved[0] != parameters.p).tolist()
    for k, nuisance in enumerate(nuisances):
        if nuisance.kind is NuisanceKind.VEHICLE and list(nuisance.at) == changed:
            slope = float(moved[0][changed[0]] - moved[1][changed[0]]) / step
            return Alias(k, changed[0], slope) if slope else None
    return None


def resolve_aliases(model: Model, nuisances: Sequence[Nuisance], base: ParameterSet) -> Model:
    """The model with the most likely split between each term and its alias; ``base`` is the nominal vehicle."""
    for k, term in enumerate(model.terms):
        alias = alias_of(term, nuisances, base.with_nuisances(nuisances, model.z))
        if alias is None:
            continue
        step, spread = nuisances[alias.nuisance].step[0], term.candidate.prior_sd * alias.slope
        wanted = _value(term, base.with_nuisances(nuisances, model.z), alias)
        z = model.z.copy()
        z[alias.nuisance] = (wanted - alias.of(base)) * step / (step**2 + spread**2)
        without = base.with_nuisances(nuisances, z)
        parameter = term.candidate.parameter

        def excess(
            value: float,
            term: Term = term,
            without: ParameterSet = without,
            alias: Alias = alias,
            wanted: float = wanted,
        ) -> float:
            return _value(replace(term, value=value), without, alias) - wanted

        if excess(parameter.low) * excess(parameter.high) >= 0.0:
            continue
        terms = list(model.terms)
        terms[k] = replace(term, value=float(brentq(excess, parameter.low, parameter.high, xtol=1e-12)))
        cost = model.cost + float(z @ z - model.z @ model.z)
        model = replace(model, z=z, terms=tuple(terms), cost=cost)
    return model


def _value(term: Term, parameters: ParameterSet, alias: Alias) -> float:
    """The aliased parameter as the equations read it, term included."""
    p = None if alias.latency else _parameters_with(term, term.value, parameters)
    if p is None:
        return alias.of(parameters) + (term.value if alias.latency else 0.0)
    return float(p[alias.at])


def _parameters_with(term: Term, value: float, parameters: ParameterSet) -> Floats | None:
    """Parameters, (parameters,), as the equations read them with the term; None where it changes more than these."""
    effect = term.candidate.effect
    if effect.static is None or effect.dynamic is not None or effect.rates is not None or effect.sensing:
        return None
    q, y = np.zeros(Q.size), np.zeros(OUTPUT.size)
    q[: PARAMETER.size] = parameters.p
    theta = term.candidate.applied(replace(parameters, theta=THETA.neutral()), value).theta
    q[Q.slice("theta")] = theta
    first = Q.slice("theta").start + THETA.slice(effect.name, effect.parameters[0].name).start
    getattr(effect.static, "py_func", effect.static)(q, first, y)
    return None if y.any() else q[: PARAMETER.size]

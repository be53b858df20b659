"""Candidates of the quantities whose nuisance parameters stand at their bounds.

Where a cause is larger than any tolerance, many nuisance parameters share in it until each is at its bound, and from
there no fit finds back. Takes a fitted model; gives the candidates that are the same quantities, for fits of their own.
"""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.estimation.aliases import alias_of
from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.estimation.model import Model, Term
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.vehicle.priors import NuisanceKind
from plant.injection.theta import THETA

_AT_BOUND = 0.9
"""Share of its bound from which on a nuisance parameter stands there."""
_WHEELS = {"front": (0, 1), "rear": (2, 3)}
_IN_THETA = (NuisanceKind.SENSOR, NuisanceKind.SIDE_TO_SIDE)


def candidates_at_bounds(fitter: Fitter, model: Model, candidates: Sequence[Candidate]) -> list[Candidate]:
    """One candidate for each quantity at its bound: of the wheels, that of all that stand at a bound on one side."""
    parts, aliased = _at_bounds(fitter, model)
    pads = THETA.slice("pad_mu_gain", "gain").start
    for axle, members in _WHEELS.items():  # the gain of a brake is that of its pads
        side = aliased.pop(f"brake_gain_{axle}", 0.0)
        parts |= {pads + member: side for member in members} if side else {}
    found: dict[tuple[str, str], Candidate] = {}
    for one in candidates:
        start = THETA.slice(one.effect.name, one.parameter.name).start
        sides = {parts.get(start + member, 0.0) for member in one.members()}
        key = one.effect.name, one.parameter.name
        whole = len(sides) == 1 and sides != {0.0}
        if whole and (key not in found or len(one.members()) > len(found[key].members())):
            found[key] = one
    base = fitter.base.with_nuisances(fitter.nuisances, model.z)
    for one in candidates:
        alias = (
            alias_of(Term(one, 0.1 * one.parameter.typical), fitter.nuisances, base) if one.parameter.typical else None
        )
        if alias is not None and fitter.nuisances[alias.nuisance].name in aliased:
            found.setdefault((one.effect.name, one.parameter.name), one)
    return list(found.values())


def _at_bounds(fitter: Fitter, model: Model) -> tuple[dict[int, float], dict[str, float]]:
    """Sides on which nuisances stand at their bounds: by index in theta, and of all others by name."""
    parts: dict[int, float] = {}
    others: dict[str, float] = {}
    for nuisance, z in zip(fitter.nuisances, model.z, strict=True):
        limit = nuisance.upper if z > 0.0 else -nuisance.lower
        if abs(z) < _AT_BOUND * limit or not limit:
            continue
        if nuisance.kind in _IN_THETA:
            parts |= dict.fromkeys(nuisance.at, float(np.sign(z)))
        else:
            others[nuisance.name] = float(np.sign(z))
    return parts, others

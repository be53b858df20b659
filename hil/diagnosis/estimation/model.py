"""A fitted vehicle, and the terms that it has beside the nominal one."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.terms import Candidate
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet

Tracks = dict[str, Floats]
_ALIKE = 0.2
"""Share by which the value of a term may change while its signature serves on."""


@dataclass(frozen=True, eq=False)
class Term:
    """A candidate with a value, and its onset as (recording, s in it); None: acts throughout."""

    candidate: Candidate
    value: float
    onset: tuple[int, float] | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """A fitted vehicle: nuisances ``z`` in prior standard deviations and terms.

    ``residual`` tracks, (samples, 1), simulated ``channels`` and ``cost`` are at exactly this point; ``covariance``
    (terms, terms) is that of the values. ``driven_by`` are the inputs of the channels (`Simulator.driven_by`).
    ``unrealised`` is the decrease of the cost that a linear step from here foresaw, where no share of it gave any.
    """

    z: Floats
    terms: tuple[Term, ...]
    residual: Tracks
    cost: float
    covariance: Floats
    channels: Stack = field(default_factory=dict)
    driven_by: object = None
    unrealised: float = 0.0

    def values(self) -> list[float]:
        """Values of the terms."""
        return [term.value for term in self.terms]


def same_terms(some: Sequence[Term], others: Sequence[Term]) -> bool:
    """Same candidates with the same onsets, at values whose signatures are alike."""
    if [(one.candidate, one.onset) for one in some] != [(other.candidate, other.onset) for other in others]:
        return False
    before, after = (np.array([term.value for term in terms]) for terms in (some, others))
    return bool((np.abs(after - before) <= _ALIKE * np.maximum(np.abs(before), np.abs(after))).all())


def with_term(parameters: ParameterSet, term: Term) -> ParameterSet:
    """The parameter set with a term at its value, from its onset on."""
    always = term.candidate.applied(parameters, term.value)
    if term.onset is None:
        return always
    return always.with_onset(term.candidate.effect.name, *term.onset, before=parameters)


@dataclass(frozen=True, eq=False)
class TakenJacobian:
    """A term Jacobian, at which ``model`` by which inputs (`Simulator.driven_by`) and steps of the values."""

    driven_by: object
    model: Model
    steps: list[float]
    tracks: Tracks

    def at(self, driven_by: object, model: Model, steps: list[float]) -> bool:
        """Taken at exactly this point."""
        terms = [[(one.candidate, one.value, one.onset) for one in of.terms] for of in (self.model, model)]
        same = self.driven_by is driven_by and self.steps == steps and terms[0] == terms[1]
        return same and bool((self.model.z == model.z).all())

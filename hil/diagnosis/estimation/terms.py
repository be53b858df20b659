"""Candidates: every listed effect, each of its parameters, at each location where it can act.

Takes the effects of the plant; gives the columns of their Jacobian and the candidates made of these.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from plant.effects.effect import NODES, Effect, Parameter, Scope
from plant.injection.theta import THETA

LOCATIONS: Mapping[Scope, Mapping[str, tuple[int, ...]]] = {
    Scope.CAR: {"car": (0,)},
    Scope.AXLE: {"car": (0, 1), "front": (0,), "rear": (1,)},
    Scope.WHEEL: {
        "car": (0, 1, 2, 3), "front": (0, 1), "rear": (2, 3), "left": (0, 2), "right": (1, 3),
        "fl": (0,), "fr": (1,), "rl": (2,), "rr": (3,),
    },
    Scope.NODE: {node: (k,) for k, node in enumerate(NODES)},
}  # fmt: skip
"""Members of a scope that move together, by the name of the location."""
_KINDS = {
    "front": "axle", "rear": "axle", "left": "side", "right": "side",
    "fl": "wheel", "fr": "wheel", "rl": "wheel", "rr": "wheel",
}  # fmt: skip
PRIOR_SD_IN_TYPICAL_SIZES = 1.5
"""Prior standard deviation of a value, in sizes typical of real cars: no value is preferred within these."""
_PRIOR_FREEDOM = 4.0
"""Degrees of freedom of the prior's tails: few, as pads that drag with 6 N m in a good car drag with 200 where they
bind."""


def log_prior(value: float, sd: float) -> float:
    """Log of the prior density of a value, relative to that of 0: Student's t.

    Within two standard deviations it is nearly normal. A normal prior would take a value that is far beyond for
    impossible, whatever the data say (O'Hagan 1979, J. R. Stat. Soc. B 41, 358).
    """
    return -0.5 * (_PRIOR_FREEDOM + 1.0) * float(np.log1p((value / sd) ** 2 / _PRIOR_FREEDOM))


def location_kind(location: str) -> str:
    """Axle, side or wheel; the car, and each node, is a kind by itself."""
    return _KINDS.get(location, location)


@dataclass(frozen=True, eq=False)
class Column:
    """One entry of the effect vector theta, as a column of the Jacobian, and its step for a finite difference."""

    effect: Effect
    parameter: Parameter
    member: int

    @property
    def at(self) -> int:
        """Index in theta."""
        return int(THETA.slice(self.effect.name, self.parameter.name).start) + self.member

    @property
    def step(self) -> float:
        """Of a finite difference, in the parameter's unit."""
        return self.parameter.step

    def stepped(self, parameters: ParameterSet) -> ParameterSet:
        """The parameter set with this entry one step off."""
        return parameters.adding((self.at,), self.step)


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect parameter at a location; its ``columns`` move together.

    ``locations`` is how many parameters and locations its effect has, ``suspension_stated`` that the vehicle set states
    the suspension, ``form_sd`` what of it the form of the model may imitate (in its unit), ``selection_penalty`` what
    its gain loses as the data chose more of it than its value.
    """

    effect: Effect
    parameter: Parameter
    location: str
    columns: tuple[int, ...]
    locations: int
    suspension_stated: bool = field(default=True, kw_only=True)
    form_sd: float = field(default=0.0, kw_only=True)
    selection_penalty: float = field(default=0.0, kw_only=True)

    @property
    def name(self) -> str:
        """Name in reports and keys: effect, parameter if there are several, location."""
        extra = "" if len(self.effect.strengths) == 1 else f".{self.parameter.name}"
        return f"{self.effect.name}{extra}@{self.location}"

    @property
    def prior_sd(self) -> float:
        """Prior standard deviation of the value."""
        return PRIOR_SD_IN_TYPICAL_SIZES * typical_size(self.parameter)

    def members(self) -> tuple[int, ...]:
        """Members of the effect's scope that it moves."""
        return LOCATIONS[self.effect.scope][self.location]

    def applied(self, parameters: ParameterSet, value: float) -> ParameterSet:
        """The parameter set with ``value`` added to the parameter at the location."""
        start = THETA.slice(self.effect.name, self.parameter.name).start
        return parameters.adding([start + member for member in self.members()], value)


def summed(q: Floats, candidates: Sequence[Candidate], offset: int = 0) -> Floats:
    """Information matrix of the candidates, (candidates, candidates): columns of one candidate are summed."""
    moves = np.zeros((len(candidates), q.shape[0]))
    for row, candidate in enumerate(candidates):
        moves[row, [offset + k for k in candidate.columns]] = 1.0
    return np.asarray(moves @ q @ moves.T)


def typical_size(parameter: Parameter) -> float:
    """Size typical of real cars, in its unit; a third of the range of what has none."""
    return abs(parameter.typical) or 0.5 * (parameter.high - parameter.low) / PRIOR_SD_IN_TYPICAL_SIZES


def columns(without: Collection[str] = ()) -> list[Column]:
    """Every strength parameter of every effect at every member, but for the effects ``without``."""
    listed = []
    for effect in THETA.effects:
        if effect.name in without:
            continue
        for parameter in effect.strengths:
            listed += [Column(effect, parameter, member) for member in range(parameter.size(effect.scope))]
    return listed


def candidates(
    of: list[Column], undriven: Collection[int] = (), sprung: bool = True, quiet: Collection[str] = (),
    form_share: float = 0.0,
) -> list[Candidate]:  # fmt: skip
    """All locations of all strength parameters that have columns.

    Motor effects have no location with an ``undriven`` wheel, sensing effects none at ``quiet`` nodes, whose channels
    show nothing. ``sprung`` says that the vehicle set states the suspension, ``form_share`` what share of a typical
    size the form of the model may imitate.
    """
    index: Mapping[tuple[str, str, int], int] = {
        (column.effect.name, column.parameter.name, column.member): k for k, column in enumerate(of)
    }
    listed = []
    for effect in dict.fromkeys(column.effect for column in of):
        groups = LOCATIONS[effect.scope]
        if effect.scope is Scope.WHEEL and effect.subsystem == "motors":
            groups = {location: members for location, members in groups.items() if not {*members} & {*undriven}}
        if effect.scope is Scope.NODE:
            groups = {node: members for node, members in groups.items() if node not in quiet}
        for parameter in effect.strengths:
            for location, members in groups.items():
                at = tuple(index[effect.name, parameter.name, member] for member in members)
                listed.append(
                    Candidate(
                        effect,
                        parameter,
                        location,
                        at,
                        len(groups) * len(effect.strengths),
                        suspension_stated=sprung,
                        form_sd=form_share * typical_size(parameter),
                    )
                )
    return listed

"""What may be wrong: every listed effect, each of its numbers, at each place where it can act."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from plant.effects.effect import NODES, Effect, Parameter, Scope
from plant.injection.theta import THETA

_SHARE = 0.05
_SHARES = {
    ("sus_compliance", "compliance_m_n"): 0.5, ("regen_fadeout", "speed_mps"): 0.6,
    ("pressure_hysteresis", "half_width_pa"): 0.5, ("stuck_corner", "held_pa"): 0.5,
}  # fmt: skip
"""Of what is usual, for a finite difference; stiffer hubs would swing too fast for the replay's steps, motors are not
compared just above the speed where they fade, a play narrower than what is left of noise in the measured pressures
follows that, and a pressure that is held does nothing below the threshold."""
LOCATIONS: Mapping[Scope, Mapping[str, tuple[int, ...]]] = {
    Scope.CAR: {"car": (0,)},
    Scope.AXLE: {"car": (0, 1), "front": (0,), "rear": (1,)},
    Scope.WHEEL: {
        "car": (0, 1, 2, 3), "front": (0, 1), "rear": (2, 3), "left": (0, 2), "right": (1, 3),
        "fl": (0,), "fr": (1,), "rl": (2,), "rr": (3,),
    },
    Scope.NODE: {node: (k,) for k, node in enumerate(NODES)},
}  # fmt: skip
"""Members of a scope that move together, by the name of the place."""
_KINDS = {
    "front": "axle", "rear": "axle", "left": "side", "right": "side",
    "fl": "wheel", "fr": "wheel", "rl": "wheel", "rr": "wheel",
}  # fmt: skip
_MOTOR = "motor."
"""Joints of the motors."""
PRIOR_SD_IN_TYPICAL_SIZES = 1.5
"""Standard deviation before any data, in sizes met on real cars."""


def location_kind(place: str) -> str:
    """Axle, side or wheel; the car, and each node, is a kind by itself."""
    return _KINDS.get(place, place)


@dataclass(frozen=True, eq=False)
class Column:
    """One number of theta that is moved: its place, and by how much for a finite difference."""

    effect: Effect
    parameter: Parameter
    member: int

    @property
    def at(self) -> int:
        """Index in theta."""
        return int(THETA.slice(self.effect.name, self.parameter.name).start) + self.member

    @property
    def step(self) -> float:
        """A small share of what is met on real cars, on the side that is allowed: many effects show long before."""
        share = _SHARES.get((self.effect.name, self.parameter.name), _SHARE)
        return self.parameter.typical * share if self.parameter.typical else 0.3 * share * self.parameter.high

    def stepped(self, world: ParameterSet) -> ParameterSet:
        """The world with the number one step off."""
        theta: Floats = world.theta.copy()
        theta[self.at] += self.step
        return replace(world, theta=theta)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A listed effect's number at a place; its columns move together. ``sprung``: the set states the car's springs.

    ``price`` is what takes off its gain that the data chose something of it beside its value.
    """

    effect: Effect
    parameter: Parameter
    location: str
    columns: tuple[int, ...]
    locations: int
    suspension_stated: bool = field(default=True, kw_only=True)
    selection_penalty: float = field(default=0.0, kw_only=True)

    @property
    def name(self) -> str:
        """For people and keys."""
        extra = "" if len(self.effect.strengths) == 1 else f".{self.parameter.name}"
        return f"{self.effect.name}{extra}@{self.location}"

    @property
    def prior_sd(self) -> float:
        """Standard deviation of its value before any data."""
        parameter = self.parameter
        return (
            PRIOR_SD_IN_TYPICAL_SIZES * abs(parameter.typical)
            if parameter.typical
            else 0.5 * (parameter.high - parameter.low)
        )

    def members(self) -> tuple[int, ...]:
        """Members of the effect's scope it moves."""
        return LOCATIONS[self.effect.scope][self.location]

    def applied(self, world: ParameterSet, value: float) -> ParameterSet:
        """The world with this number set (added to what is there) at this place."""
        theta: Floats = world.theta.copy()
        start = THETA.slice(self.effect.name, self.parameter.name).start
        for member in self.members():
            theta[start + member] += value
        return replace(world, theta=theta)


def columns(without: Collection[str] = ()) -> list[Column]:
    """Every strength of every effect at every member, but for the effects ``without``."""
    found = []
    for effect in THETA.effects:
        if effect.name in without:
            continue
        for parameter in effect.strengths:
            found += [Column(effect, parameter, member) for member in range(parameter.size(effect.scope))]
    return found


def candidates(
    of: list[Column], undriven: Collection[int] = (), sprung: bool = True, quiet: Collection[str] = ()
) -> list[Candidate]:
    """All places of all strengths that have columns; of motors, those with one at every wheel.

    Where the rear wheels are ``undriven``, the motor on the right is the one front right. ``sprung``: whether the set
    states the suspension. Of nodes that are ``quiet`` neither scale, stamps nor clock is asked.
    """
    index: Mapping[tuple[str, str, int], int] = {
        (column.effect.name, column.parameter.name, column.member): k for k, column in enumerate(of)
    }
    found = []
    for effect in dict.fromkeys(column.effect for column in of):
        groups = LOCATIONS[effect.scope]
        if effect.scope is Scope.WHEEL and all(joint.startswith(_MOTOR) for joint in effect.injection_points):
            groups = {place: members for place, members in groups.items() if not {*members} & {*undriven}}
        if effect.scope is Scope.NODE:
            groups = {node: members for node, members in groups.items() if node not in quiet}
        for parameter in effect.strengths:
            for place, members in groups.items():
                at = tuple(index[effect.name, parameter.name, member] for member in members)
                found.append(
                    Candidate(
                        effect, parameter, place, at, len(groups) * len(effect.strengths), suspension_stated=sprung
                    )
                )
    return found

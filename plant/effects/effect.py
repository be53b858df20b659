"""An effect as a value: what it is called, where it acts, how large it may be, and its equations."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from plant.excitation import Excitation
from plant.layout import constants

NODES = ("wheel", "imu", "pressure", "motor", "driver")
GROUND = "ground"
"""What measures the speed over ground: a logger's own receiver or optical sensor, on no vehicle bus."""
NODE_LATENCY = "node_latency_s"
"""By how much a node's frames come later than the wheel speeds': a number of every node, of no parameter set."""
USUAL_STEP = 0.05
"""Step of a finite difference, as a share of the typical size: many effects show long before that is reached."""


class Scope(StrEnum):
    """What has a value of its own."""

    CAR = "car"
    AXLE = "axle"
    WHEEL = "wheel"
    NODE = "node"  # of the vehicle bus, in the order of `NODES`

    @property
    def size(self) -> int:
        """How many values there are."""
        return {"car": 1, "axle": 2, "wheel": 4, "node": len(NODES)}[self.value]

    @property
    def members(self) -> tuple[str, ...]:
        """Their names, in order."""
        names = {"axle": ("front", "rear"), "wheel": ("fl", "fr", "rl", "rr"), "node": NODES}
        return names.get(self.value, ("car",))


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    Attributes
    ----------
    name, unit : SI; empty unit for a share or a coefficient.
    low, high : bounds, both allowed.
    typical : size met on real cars; the sign is the more frequent one.
    neutral : where the effect is absent. All strengths are 0 there.
    shape : True for a number that says how, not how much: it has one value, and no meaning while the strengths are 0.
    difference_step : step of a finite difference by it, as a share of ``typical``; larger where a small one changes
        nothing or is lost in noise, or where a large one would have to be followed in smaller steps of time.
    sign_along_road : whether it changes sign when the same stretch of road is driven back.
    part_to_part : standard deviation from one part of a kind to the next, where it is known; 0 where it is not.
    aliases : numbers of the vehicle that are the same quantity, names of ``PARAMETER`` or `NODE_LATENCY`: it changes
        them and nothing else, so that no data tell the two apart.
    factor : 1 where it multiplies something by 1 + value, -1 by 1 - value, 0 where it is no factor.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    neutral: float = 0.0
    shape: bool = False
    difference_step: float = USUAL_STEP
    sign_along_road: bool = False
    part_to_part: float = 0.0
    aliases: tuple[str, ...] = ()
    factor: int = 0

    @property
    def step(self) -> float:
        """Step of a finite difference from the neutral value, in ``unit``, on the side where it is more often."""
        share = self.difference_step
        return self.typical * share if self.typical else 0.3 * share * self.high

    def size(self, scope: Scope) -> int:
        """How many values it has."""
        return 1 if self.shape else scope.size


def shape(name: str, unit: str, low: float, high: float, value: float) -> Parameter:
    """A shape parameter; its usual value is also its neutral one."""
    return Parameter(name, unit, low, high, value, value, shape=True)


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical cause.

    Attributes
    ----------
    name : field name, also in scenarios and reports.  row : of the effect catalogue.
    title : one line for people.  equation : in words of mathematics.
    injection_points : where it acts (`plant.injection_points`).
    parameters, scope : its numbers and what has values of its own.
    acts_when : what must be going on for it to change the motion, or an input measured on the way: one for all members,
        or one for each.
    baseline_section : section of the parameter set that states what it departs from: where a car's section is not
        known, nothing can be said of the effect. Empty where it shows without.
    free_phase : whether its pattern may begin at any angle of the wheel, and turn with a log of its own.
    source : where equation and sizes are from.  signature : what it leaves in the residuals.
    confounded_with : what looks alike in some manoeuvres.  twins : what looks alike in every manoeuvre of this model.
    manoeuvre : which of `plant.open_loop_manoeuvres` shows it.
    dissipates : whether it may only take energy out of the motion.
    states : extra states it uses.
    static : ``(q, k, y)``, from its numbers alone.  dynamic : ``(x, u, q, k, y)``, from the state.
    rates : ``(x, u, q, k, y)``, of its extra states.  Its numbers begin at ``k`` in ``q``; parameters are changed in
        ``q``, injection points in ``y``.
    sense : of a sensing effect, which acts on measured arrays and not in the model (`plant.injection.sensing_chain`).
    undo : its inverse on arrays, where it has one.  late_s : of one that only delays: by how long, s.
    nodes : of `NODES`, or `GROUND`, whose signals a sensing effect changes.
    """

    name: str
    row: int
    title: str
    equation: str
    injection_points: tuple[str, ...]
    scope: Scope
    parameters: tuple[Parameter, ...]
    source: str
    signature: str
    manoeuvre: str
    acts_when: Excitation | tuple[Excitation, ...] = Excitation.ALWAYS
    baseline_section: str = ""
    free_phase: bool = False
    confounded_with: tuple[str, ...] = ()
    twins: tuple[str, ...] = ()
    dissipates: bool = False
    states: tuple[str, ...] = ()
    static: Callable[..., None] | None = None
    dynamic: Callable[..., None] | None = None
    rates: Callable[..., None] | None = None
    sense: Callable[..., Any] | None = None
    undo: Callable[..., Any] | None = None
    late_s: Callable[..., Any] | None = None
    nodes: tuple[str, ...] = ()

    @property
    def subsystem(self) -> str:
        """Part of the car, the package of `plant.effects` it is declared in; empty for an effect from outside."""
        first = next(f for f in (self.sense, self.static, self.dynamic, self.rates) if f is not None)
        package = str(first.__module__).split(".")
        return package[2] if package[:2] == ["plant", "effects"] else ""

    @property
    def sensing(self) -> bool:
        """Whether it acts on what is measured and not in the model."""
        return self.sense is not None

    def excitation(self, member: int) -> Excitation:
        """What must be going on for its value at one member of its scope to matter."""
        return self.acts_when[member] if isinstance(self.acts_when, tuple) else self.acts_when

    def parameter(self, name: str) -> Parameter:
        """One parameter by name; KeyError where there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(f"{self.name} has no parameter {name!r}; it has {[p.name for p in self.parameters]}")

    @property
    def strengths(self) -> tuple[Parameter, ...]:
        """The parameters that say how much."""
        return tuple(p for p in self.parameters if not p.shape)


def slots(scope: Scope, parameters: tuple[Parameter, ...]) -> Any:
    """Where each parameter begins, counted from the effect's first number: constants to compiled code."""
    return constants("Slots", {p.name: p.size(scope) for p in parameters})

"""An effect as a value: what it is called, where it acts, how large it may be, and its equations."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from plant.layout import constants

NODES = ("wheel", "imu", "pressure", "motor", "driver")
GROUND = "ground"
"""What measures the speed over ground: a logger's own receiver or optical sensor, on no vehicle bus."""


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
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    neutral: float = 0.0
    shape: bool = False

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
    source : where equation and sizes are from.  signature : what it leaves in the residuals.
    confounded_with : what looks alike in some manoeuvres.  twins : what looks alike in every manoeuvre of this model.
    manoeuvre : which of `plant.open_loop_manoeuvres` shows it.
    dissipates : whether it may only take energy out of the motion.
    states : extra states it uses.
    static : ``(q, k, y)``, from its numbers alone.  dynamic : ``(x, u, q, k, y)``, from the state.
    rates : ``(x, u, q, k, y)``, of its extra states.  Its numbers begin at ``k`` in ``q``; parameters are changed in
        ``q``, injection points in ``y``.
    sense : of a sensing effect, which acts on measured arrays and not in the model (`plant.injection.sensing_chain`).
    undo : its inverse on arrays, where it has one.
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
    confounded_with: tuple[str, ...] = ()
    twins: tuple[str, ...] = ()
    dissipates: bool = False
    states: tuple[str, ...] = ()
    static: Callable[..., None] | None = None
    dynamic: Callable[..., None] | None = None
    rates: Callable[..., None] | None = None
    sense: Callable[..., Any] | None = None
    undo: Callable[..., Any] | None = None
    nodes: tuple[str, ...] = ()

    @property
    def sensing(self) -> bool:
        """Whether it acts on what is measured and not in the model."""
        return self.sense is not None

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

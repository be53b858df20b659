"""Effects in scenarios, and effects that others add through the entry-point group ``brakebench.effects``."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from hil.errors import BrakebenchError
from plant.effects.effect import NODES, Effect, Scope
from plant.inject import J
from plant.injection.apply import SIZE
from plant.injection.bank import NO_TERMS, Shape, Variable, term
from plant.injection.plugin import NO_PLUGINS, table
from plant.injection.theta import THETA, Theta
from plant.injection_points import INJECTION_POINTS
from plant.injection_points import field as place
from plant.layout import Vector
from plant.vectors import INPUT, OUTPUT, STATE

GROUP = "brakebench.effects"


class EffectError(BrakebenchError):
    """An effect that cannot be used as it is; the message names effect and parameter."""


@cache
def plugins() -> tuple[Effect, ...]:
    """Effects that installed distributions offer; each entry point names one `plant.effects.effect.Effect`."""
    found = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        effect = point.load()
        if not isinstance(effect, Effect):
            raise EffectError(f"entry point {point.name} ({point.value}): expected an Effect, got {effect!r}")
        if effect.static is not None or effect.sense is not None:
            raise EffectError(f"effect {effect.name} ({point.value}): only dynamic and rates can come from outside")
        found.append(effect)
    return tuple(found)


@cache
def layout() -> Theta:
    """Where the numbers of all effects lie, those from outside included."""
    return Theta(plugins())


@dataclass(frozen=True, slots=True, eq=False)
class Effects:
    """The effects of one run.

    Attributes
    ----------
    on : names of those a scenario switches on, also later.
    theta : their numbers; times are of the manoeuvre's clock.
    layout : where they lie.  terms : of the basis bank.  plugins : pointers of the effects from outside.
    """

    on: tuple[str, ...] = ()
    theta: Vector = field(default_factory=THETA.neutral)
    layout: Theta = THETA
    terms: Vector = field(default_factory=NO_TERMS.copy)
    plugins: Vector = field(default_factory=NO_PLUGINS.copy)

    def for_node(self) -> dict[str, Any]:
        """Keyword arguments of `plant.node.PlantNode`."""
        return {"theta": self.theta, "layout": self.layout, "terms": self.terms, "plugins": self.plugins}

    def number(self, effect: str, parameter: str) -> Vector:
        """Values of a parameter of an effect, one for each of its members."""
        return self.theta[self.layout.slice(effect, parameter)]

    def without(self, *injection_points: str) -> "Effects":
        """Without those that act at some of these injection points, laws of one variable included."""
        theta, neutral = self.theta.copy(), self.layout.neutral()
        out = [effect for effect in self.layout.effects if set(effect.injection_points) & set(injection_points)]
        for effect in out:
            for name in ("onset_s", "until_s", *(parameter.name for parameter in effect.parameters)):
                where = self.layout.slice(effect.name, name)
                theta[where] = neutral[where]
        at = {int(getattr(J, place(point))) for point in injection_points}
        kept = [row for row in self.terms if int(row[0]) - (int(row[1]) if row[2] > 0.5 else 0) not in at]
        on = tuple(name for name in self.on if name not in {effect.name for effect in out})
        return replace(self, on=on, theta=theta, terms=np.array(kept) if kept else NO_TERMS.copy())


NONE = Effects()
_EARLY = (("timestamp_offset", "delay_s"), ("clock_drift", "share"))
"""Numbers that, below 0, put a node's samples before they are taken: a log may show it, no running node can do it."""


def plugin_table(effects: Theta) -> Vector:
    """Compiled equations of the effects from outside."""
    outside = [effect for effect in effects.effects if effect in plugins()]
    places = [
        (
            effects.slice(effect.name, effect.parameters[0].name).start,
            effects.slice(effect.name, "onset_s").start,
        )
        for effect in outside
    ]
    return table(outside, places, (STATE.size, INPUT.size, SIZE, OUTPUT.size)) if outside else NO_PLUGINS


def read_effects(tables: Mapping[str, Any], where: str) -> Effects:
    """Effects out of the table ``[effects]`` of a scenario: one table for each.

    In it each parameter is a number, a list (one for each member) or a table by member (``{fl = 0.2}``); ``onset_s``
    and ``until_s`` are of the manoeuvre's clock; ``at`` names the members it is to act on. Without any strength it acts
    at its typical size. The list ``laws`` has curves of one variable at an injection point, see `read_laws`.

    Raises
    ------
    EffectError
        No such effect or parameter, a number out of bounds.
    """
    tables = dict(tables)
    terms = read_laws(tables.pop("laws", []), f"{where}.laws")
    if not tables and not len(terms):
        return NONE
    effects = layout()
    theta = effects.neutral()
    for name, values in tables.items():
        if not isinstance(values, Mapping):
            raise EffectError(f"{where}.{name}: expected a table, got {values!r}")
        if name not in {effect.name for effect in effects.effects}:
            near = get_close_matches(name, [effect.name for effect in effects.effects], 3)
            hint = f"did you mean {', '.join(near)}?" if near else "`brakebench effects` lists them"
            raise EffectError(f"{where}.{name}: no such effect; {hint}")
        try:
            effects.set(theta, name, _filled(effects.effect(name), values, f"{where}.{name}"))
        except (KeyError, ValueError, TypeError) as error:
            raise EffectError(f"{where}.{name}: {error.args[0] if error.args else error}") from error
    _refuse_early(effects, theta, where)
    _refuse_unseen(theta[effects.slice("speed_scale", "gain")][0], f"{where}.speed_scale")
    return Effects(tuple(tables), theta, effects, terms, plugin_table(effects))


def _refuse_early(effects: Theta, theta: Vector, where: str) -> None:
    for name, number in _EARLY:
        values = theta[effects.slice(name, number)]
        if values.min() < 0.0:
            node = NODES[int(values.argmin())]
            raise EffectError(
                f"{where}.{name}.{number}: expected 0 or more, got {values.min():g} ({node}): a running node cannot "
                "send a sample before it is taken; leave it out, or make the other nodes late by as much"
            )


def _refuse_unseen(gain: float, where: str) -> None:
    if gain:
        raise EffectError(
            f"{where}.gain: expected 0, got {gain:g}: no bus of the bench has a sensor of the speed over ground; leave "
            "it out, it changes nothing that a car does"
        )


def read_laws(laws: Any, where: str) -> Vector:
    """Rows of the basis bank out of a list of tables: hats of one variable at an injection point.

    Each has ``injection_point``, ``variable`` (of `plant.injection.bank.Variable`, lower case), ``centre``, ``width``,
    ``value``, ``adds`` (to the point, else a share of it) and, at points of the wheels, ``at``, the wheels.

    Raises
    ------
    EffectError
        No such injection point or variable, a number missing or no number.
    """
    rows = []
    for k, law in enumerate(laws if isinstance(laws, list) else [laws]):
        if not isinstance(law, Mapping):
            raise EffectError(f"{where}[{k}]: expected a table, got {law!r}")
        try:
            members = [Scope.WHEEL.members.index(wheel) for wheel in law.get("at", [])]
            value = float(law["value"])
            coefficient = [value if i in members else 0.0 for i in range(4)] if "at" in law else value
            shaped = (Variable[str(law["variable"]).upper()], Shape.HAT, float(law["centre"]), float(law["width"]))
            rows.append(term(law["injection_point"], coefficient, shaped, add=bool(law.get("adds", False))))
        except KeyError as error:
            raise EffectError(f"{where}[{k}]: {error.args[0]!r} is missing or unknown") from error
        except (ValueError, TypeError) as error:
            raise EffectError(f"{where}[{k}]: {error.args[0] if error.args else error}") from error
    return np.array(rows) if rows else NO_TERMS.copy()


def written_laws(terms: Vector) -> list[dict[str, Any]]:
    """Tables that `read_laws` makes the same rows of; for hats at the points of `plant.injection_points`.

    Raises
    ------
    EffectError
        A row that acts on a number of the parameter set.
    """
    begins = {int(getattr(J, place(point))): point for point in INJECTION_POINTS}
    laws = []
    for row in terms:
        target, size, adds = int(row[0]), int(row[1]), bool(row[2] > 0.5)
        if target < 0:
            raise EffectError("a law at a number of the parameter set; expected one at an injection point")
        law: dict[str, Any] = {"injection_point": begins[target - (size if adds else 0)]}
        law |= {"variable": Variable(int(row[7])).name.lower(), "adds": adds}
        law |= {"centre": float(row[9]), "width": float(row[10]), "value": float(row[3])}
        if size == len(Scope.WHEEL.members):
            acting = np.flatnonzero(row[3 : 3 + size])
            law |= {"value": float(row[3 + acting[0]]) if acting.size else 0.0}
            law |= {"at": [Scope.WHEEL.members[k] for k in acting]}
        laws.append(law)
    return laws


def _filled(effect: Effect, values: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Values with typical sizes where no strength is given, at the members named."""
    given = dict(values)
    members = given.pop("at", list(effect.scope.members))
    odd = [member for member in members if member not in effect.scope.members]
    if odd:
        raise EffectError(f"{where}.at: no {odd[0]!r}; expected some of {', '.join(effect.scope.members)}")
    strengths = [parameter for parameter in effect.strengths if parameter.name in given]
    if not strengths:
        given |= {parameter.name: parameter.typical for parameter in effect.strengths}
    for parameter in effect.strengths:
        if isinstance(given.get(parameter.name), int | float) and effect.scope.size > 1:
            given[parameter.name] = dict.fromkeys(members, given[parameter.name])
    return given

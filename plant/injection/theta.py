"""Theta: one flat vector of all effects' numbers and times, with named parts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from plant.effects.catalogue import BUILT_IN
from plant.effects.effect import Effect, Parameter
from plant.layout import Vector

PLUGIN_SLOTS = 32  # numbers kept for effects from outside
ALWAYS_S = 1e12


def _sizes(effects: Sequence[Effect]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    for effect in effects:
        sizes |= {f"{effect.name}.{p.name}": p.size(effect.scope) for p in effect.parameters}
    for effect in effects:
        sizes |= {f"{effect.name}.onset_s": 1, f"{effect.name}.until_s": 1}
    return sizes


class Theta:
    """Where everything lies in theta.

    Attributes
    ----------
    effects : built-in ones, then those from outside.
    strengths : number of elements before the times: parameters of the built-in effects.
    size : total length, the same whatever comes from outside.
    factors : (size,) `plant.effects.effect.Parameter.factor` of every number.
    """

    def __init__(self, plugins: Sequence[Effect] = ()) -> None:
        self.effects = (*BUILT_IN, *plugins)
        self._by_name = {effect.name: effect for effect in self.effects}
        if len(self._by_name) != len(self.effects):
            raise ValueError("two effects have the same name; rename the one from outside")
        sizes = _sizes(BUILT_IN)
        self._at: dict[str, tuple[int, int]] = {}
        self._place(sizes, 0)
        self.strengths = sum(size for name, size in sizes.items() if not name.endswith(("onset_s", "until_s")))
        self._plugins_at = sum(sizes.values())
        outside = _sizes(plugins)
        self._place(outside, self._plugins_at)
        self.size = self._plugins_at + PLUGIN_SLOTS
        if sum(outside.values()) > PLUGIN_SLOTS:
            raise ValueError(f"effects from outside have {sum(outside.values())} numbers; room is for {PLUGIN_SLOTS}")
        self.factors = np.zeros(self.size)
        for effect in self.effects:
            for parameter in effect.parameters:
                self.factors[self.slice(effect.name, parameter.name)] = parameter.factor

    def _place(self, sizes: Mapping[str, int], start: int) -> None:
        for name, size in sizes.items():
            self._at[name] = start, size
            start += size

    def effect(self, name: str) -> Effect:
        """Effect by name; KeyError says which there are."""
        if name not in self._by_name:
            raise KeyError(f"no effect {name!r}; known: {', '.join(self._by_name)}")
        return self._by_name[name]

    def slice(self, effect: str, parameter: str) -> slice:
        """Where one parameter of an effect lies; also of ``onset_s`` and ``until_s``."""
        start, size = self._at[f"{effect}.{parameter}"]
        return slice(start, start + size)

    def neutral(self) -> Vector:
        """A car without any effect."""
        theta = np.zeros(self.size)
        for effect in self.effects:
            for parameter in effect.parameters:
                theta[self.slice(effect.name, parameter.name)] = parameter.neutral
            theta[self.slice(effect.name, "onset_s")] = -ALWAYS_S
            theta[self.slice(effect.name, "until_s")] = ALWAYS_S
        return theta

    def shifted(self, theta: Vector, start_s: float) -> Vector:
        """The same with all onsets and ends later: from the clock of a manoeuvre to that of the model."""
        late = theta.copy()
        for effect in self.effects:
            for name in ("onset_s", "until_s"):
                where = self.slice(effect.name, name)
                if abs(late[where][0]) < ALWAYS_S:
                    late[where] += start_s
        return late

    def driven_back(self, theta: Vector) -> Vector:
        """The same stretch of road, driven the other way."""
        back = theta.copy()
        for effect in self.effects:
            for parameter in effect.parameters:
                if parameter.sign_along_road:
                    back[self.slice(effect.name, parameter.name)] *= -1.0
        return back

    def changed(self, theta: Vector, change: Vector) -> Vector:
        """The same car after a ``change``, (size,), that is 0 where nothing changes.

        Factors multiply: what was 1 + e before is (1 + e)(1 + d) after a change d. All else is added.
        """
        return theta + change * (1.0 + self.factors * theta)

    def timed(self, theta: Vector) -> bool:
        """Whether any effect begins or ends at some time."""
        return not np.array_equal(self.shifted(theta, 1.0), theta)

    def set(self, theta: Vector, effect: str, values: Mapping[str, Any]) -> Vector:
        """Write an effect's numbers into ``theta``: one for all its members, one for each, or a table by member.

        Raises
        ------
        KeyError, ValueError
            No such effect, parameter or member; a wrong count; a number out of its bounds.
        """
        declared = self.effect(effect)
        for name, value in values.items():
            where = f"{effect}.{name}"
            if name in ("onset_s", "until_s"):
                theta[self.slice(effect, name)] = float(value)
                continue
            parameter = declared.parameter(name)
            numbers = _numbers(where, declared, parameter, value)
            if any(not parameter.low <= number <= parameter.high for number in numbers):
                raise ValueError(
                    f"{where}: expected {parameter.low:g} to {parameter.high:g} {parameter.unit}, got {value!r}"
                )
            theta[self.slice(effect, name)] = numbers
        return theta

    def typical(self, effect: str, member: int | None = None) -> Vector:
        """A car with one effect at its typical size, at one member (all of them with None)."""
        theta = self.neutral()
        declared = self.effect(effect)
        for parameter in declared.parameters:
            where = self.slice(effect, parameter.name)
            if parameter.shape or member is None or where.stop - where.start == 1:
                theta[where] = parameter.typical
            else:
                theta[where.start + member] = parameter.typical
        return theta


def _numbers(where: str, effect: Effect, parameter: Parameter, value: Any) -> list[float]:
    size = parameter.size(effect.scope)
    members = effect.scope.members
    if isinstance(value, Mapping):
        odd = [name for name in value if name not in members]
        if odd or size == 1:
            raise KeyError(
                f"{where}: no {odd or list(value)}; expected {', '.join(members) if size > 1 else 'a number'}"
            )
        return [float(value.get(name, parameter.neutral)) for name in members]
    if isinstance(value, Sequence) and not isinstance(value, str):
        if len(value) != size:
            raise ValueError(f"{where}: expected {size} numbers ({', '.join(members)}), got {len(value)}")
        return [float(number) for number in value]
    return [float(value)] * size


THETA = Theta()

"""Which keys of a vehicle set a fit moved, by how much, and how well they are known after it.

Takes the set as written, the vehicle, and the fitted nuisance parameters with their standard deviations.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.vehicle.bounds import bounds_of
from hil.diagnosis.vehicle.key_names import indices_of, quantity, value_of
from hil.diagnosis.vehicle.keys import ALIASES, split_name
from hil.diagnosis.vehicle.latency import LATENCY_NODES, key_of
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, Nuisance, NuisanceKind
from hil.diagnosis.vehicle.spec import Vehicle
from plant.vectors import PARAMETER

_LEARNED = 0.9
"""Share of the prior's standard deviation up to which a number counts as fitted; above, the logs say nothing of it."""
_SAME = 1e-9

Value = float | list[float]


@dataclass(frozen=True)
class FittedNumber:
    """One key of the set.

    Attributes
    ----------
    key : as the set writes it, else the one to write.  stated : the set has it.
    before, after : values; ``tolerance_before`` and ``tolerance_after`` half-widths, two standard deviations.
    moved : tolerances that it moved, signed.  at_bound : the fit would have moved it farther.
    """

    key: str
    unit: str
    what: str
    stated: bool
    before: Value
    after: Value
    tolerance_before: float
    tolerance_after: float
    moved: float
    at_bound: bool

    def as_json(self) -> dict[str, Any]:
        """Entry of ``numbers``."""
        return {
            "key": self.key, "what": self.what, "unit": self.unit, "stated": self.stated, "before": self.before,
            "after": self.after, "tolerance_before": self.tolerance_before, "tolerance_after": self.tolerance_after,
            "moved_in_tolerances": self.moved, "at_bound": self.at_bound,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Fit:
    """The fitted nuisances: (nuisances,) values and standard deviations after the fit, in those of the prior."""

    base: ParameterSet
    nuisances: Sequence[Nuisance]
    z: Floats
    sd: Floats

    def at(self, z: Floats) -> ParameterSet:
        """The car with nuisances ``z``."""
        return self.base.with_nuisances(self.nuisances, z)


def fitted_numbers(fit: Fit, vehicle: Vehicle, table: Mapping[str, Any]) -> tuple[list[FittedNumber], list[str]]:
    """Keys that the fit teaches, those that moved farthest first; and in words what moved that no key states.

    ``table`` is the set as written.
    """
    stated = [key for key, value in table.items() if not key.endswith("_tolerance") and not isinstance(value, str)]
    by_key: dict[str, list[int]] = {}
    others = []
    for k, nuisance in enumerate(fit.nuisances):
        if fit.sd[k] > _LEARNED:
            continue
        keys = _keys(nuisance, vehicle, stated)
        for key in keys:
            by_key.setdefault(key, []).append(k)
        if not keys and abs(fit.z[k]) > 1.0:
            others.append(f"{nuisance.name} by {HALF_WIDTH_TO_SIGMA * fit.z[k]:+.1f} tolerances")
    numbers = [_number(fit, vehicle, key, at, key in stated) for key, at in by_key.items()]
    found = [one for one in numbers if one is not None]
    return sorted(found, key=lambda one: -abs(one.moved)), others


def _keys(nuisance: Nuisance, vehicle: Vehicle, stated: Sequence[str]) -> list[str]:
    """Keys that state what a nuisance moves: those of the set, else a new one; none where none may.

    A first key of a section that the set leaves out would make the section count as stated, all of its limits with it.
    """
    if nuisance.kind is NuisanceKind.LATENCY:
        return [key_of(LATENCY_NODES[nuisance.at[0]])]
    if nuisance.kind not in (NuisanceKind.VEHICLE, NuisanceKind.SIGNED):
        return []
    keys = [key for key in stated if not indices_of(key).isdisjoint(nuisance.at)]
    if keys:
        return keys
    what = quantity(nuisance, vehicle)
    name = next(n for n in PARAMETER.sizes if PARAMETER.slice(n).start <= nuisance.at[0] < PARAMETER.slice(n).stop)
    section, _ = split_name(name)
    closed = section == "pad" or section in vehicle.unstated
    return [what.key] if not closed and not indices_of(what.key).isdisjoint(nuisance.at) else []


def _number(fit: Fit, vehicle: Vehicle, key: str, at: Sequence[int], stated: bool) -> FittedNumber | None:
    """A key and the nuisances ``at`` that move it."""

    def read(z: Floats) -> Value:
        return _value(key, fit.at(z))

    zero = np.zeros(len(fit.z))
    z = zero.copy()
    z[list(at)] = fit.z[list(at)]
    before, after = read(zero), read(z)
    halves = [(_half_width(read, zero, k, 1.0), _half_width(read, z, k, float(fit.sd[k]))) for k in at]
    wide, left = (max(sides) for sides in zip(*halves, strict=True))
    if left <= 0.0:
        return None
    most = max(at, key=lambda k: abs(fit.z[k]))
    nuisance = fit.nuisances[most]
    what = quantity(nuisance, vehicle)
    unit = what.unit if key == what.key else bounds_of(ALIASES.get(key, key))[2]
    bounded = not nuisance.lower + 1e-3 < fit.z[most] < nuisance.upper - 1e-3 and abs(fit.z[most]) > 1e-3
    return FittedNumber(
        key, unit, what.what, stated, before, after, wide, left, HALF_WIDTH_TO_SIGMA * float(fit.z[most]), bounded
    )


def _half_width(read: Callable[[Floats], Value], z: Floats, k: int, sd: float) -> float:
    """Two standard deviations of a key's value by one nuisance, the larger axle's."""
    step = np.zeros(len(z))
    step[k] = sd / HALF_WIDTH_TO_SIGMA
    return float(np.max(np.abs(np.subtract(read(z + step), read(z - step))))) / 2.0


def _value(key: str, parameters: ParameterSet) -> Value:
    for node, late in zip(LATENCY_NODES, parameters.latency_s, strict=True):
        if key == key_of(node):
            return late
    return value_of(key, parameters.p)

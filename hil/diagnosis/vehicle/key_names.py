"""Nuisance parameters by the keys of a vehicle set: the key to write, plain words, the unit, and a value in that unit.

`hil.diagnosis.vehicle.keys` inverted. Takes a nuisance and the car, gives its `Quantity`.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.vehicle.keys import ALIASES, DERIVED, LINE, SPECIAL
from hil.diagnosis.vehicle.priors import BRAKE_K, CONSTANT_EPSILON_W, Nuisance, NuisanceKind
from hil.diagnosis.vehicle.quantity_words import DERIVED_UNITS, IN_THETA, LATENCIES, OTHERS, PARAMETERS
from hil.diagnosis.vehicle.spec import Vehicle
from plant.friction import mu_equilibrium
from plant.injection.theta import THETA
from plant.vectors import PARAMETER, P

AXLES = ("front", "rear")
_OF_PLANT = (NuisanceKind.VEHICLE, NuisanceKind.SIGNED)
_AREA, _RADIUS, _COG = "friction_brake_piston_area_m2", "friction_brake_effective_radius_m", "vehicle_cog_to_axle_m"
_GAINS = ("brake_gain_front", "brake_gain_rear")
_ROW_S = 0.01
_COG_KEYS = ("cog_to_front_axle_m", "cog_to_rear_axle_m", "front_weight_share")
_PLACES = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}


@dataclass(frozen=True)
class Quantity:
    """What a nuisance parameter is for the reader.

    Attributes
    ----------
    key : to write in a vehicle set; empty where none states it.  has_value : False where the key has a tolerance alone.
    what : plain words.  unit : of ``shown``.  location : axle, wheel or node; empty for the car.
    shown : from the value as the simulation has it.
    """

    key: str
    what: str
    unit: str
    location: str
    shown: Callable[[float], float]
    has_value: bool = True


def stated_keys(table: Mapping[str, Any]) -> dict[str, str]:
    """Keys of a set that state a value, as they are written there, by the flat name of what they state.

    A tolerance counts for what has no value (latencies, lags). The name ends in the axle where the key is of one axle.
    """
    stated = {}
    for key, value in table.items():
        stem = key.removesuffix("_tolerance")
        if isinstance(value, str) or (key != stem and (stem in DERIVED or _flat(stem))):
            continue
        stated[_flat(stem) or stem] = stem
    return stated


def missing_keys(table: Mapping[str, Any]) -> list[str]:
    """Keys of the set's list ``required`` that neither they nor another key for the same number state."""
    required = table.get("required", [])
    stated = stated_keys({key: value for key, value in table.items() if key != "required"})
    return [key for key in map(str, required) if (_flat(key) or key) not in stated]


def _flat(stem: str) -> str:
    """Flat name that a key states; empty where it is no number of the plant."""
    if stem in DERIVED:
        name, member, _ = DERIVED[stem]
        return f"{name}_{AXLES[member]}" if member is not None and PARAMETER.sizes[name] == len(AXLES) else name
    name = ALIASES.get(stem, stem)
    return _COG if name in _COG_KEYS else name if name in SPECIAL or name in PARAMETER.sizes else ""


def indices_of(key: str) -> frozenset[int]:
    """Indices of the plant's parameters that a key of a set states a value of; none for other keys."""
    if key in DERIVED:
        name, member, _ = DERIVED[key]
        own = PARAMETER.slice(name)
        return frozenset() if member is None else frozenset({min(own.start + member, own.stop - 1)})
    name = ALIASES.get(key, key)
    if name in _GAINS:
        return frozenset({PARAMETER.slice(_AREA).start + _GAINS.index(name)})
    name = _COG if name in _COG_KEYS else name
    return frozenset(range(*PARAMETER.slice(name).indices(PARAMETER.size))) if name in PARAMETER.sizes else frozenset()


def value_of(key: str, p: Floats) -> float | list[float]:
    """Value of a key of which `indices_of` are some, in its own unit, in parameters ``p`` of the plant."""
    name = ALIASES.get(key, key)
    front, rear = p[PARAMETER.slice(_COG)]
    if name in _COG_KEYS:
        return float({"cog_to_front_axle_m": front, "cog_to_rear_axle_m": rear}.get(name, rear / (front + rear)))
    factor = 1.0
    if key in DERIVED:
        factor = 1.0 / DERIVED[key][2]
    elif name in _GAINS:
        factor = _brake_gain_per_area(p, _GAINS.index(name))
    values = [factor * float(p[at]) for at in sorted(indices_of(key))]
    return values[0] if all(value == values[0] for value in values) else values


def stated_key(nuisance: Nuisance, quantity: Quantity, stated: Mapping[str, str]) -> str:
    """Key by which a set states a nuisance, as written there; empty where it does not state it."""
    if nuisance.kind not in _OF_PLANT:
        return next((stated[key] for key in (quantity.key, _every(nuisance)) if key in stated), "")
    name = _parameter(nuisance.at[0])
    names = [f"{name}_{quantity.location}", name]
    if name == _AREA:
        names = [f"brake_gain_{quantity.location}", _AREA]
    return next((stated[one] for one in names if one in stated), "")


def _every(nuisance: Nuisance) -> str:
    """Key for the latency of all nodes."""
    return "node_latency_s" if nuisance.kind.value.endswith("latency") else ""


def quantity(nuisance: Nuisance, vehicle: Vehicle) -> Quantity:
    """Key, words and unit of a nuisance."""
    kind = nuisance.kind
    if kind in _OF_PLANT:
        return _of_plant(nuisance, vehicle)
    if kind.value.endswith("latency"):
        node = nuisance.name.removeprefix("late_")
        what = LATENCIES.get(node, f"latency of the {node.replace('_', ' ')} behind the wheel speeds")
        return Quantity(f"{node}_latency_s", what, "s", "", _same)
    if kind in (NuisanceKind.SENSOR, NuisanceKind.SIDE_TO_SIDE, NuisanceKind.LINE_LAG):
        return _of_theta(nuisance)
    what, unit = OTHERS.get(kind.value, (nuisance.name.replace("_", " "), ""))
    return Quantity("", what, unit, "", _rows_to_s if kind is NuisanceKind.TOOTH_WINDOW else _same, False)


def _of_plant(nuisance: Nuisance, vehicle: Vehicle) -> Quantity:
    name = _parameter(nuisance.at[0])
    own = PARAMETER.slice(name)
    pair = own.stop - own.start == len(AXLES)
    axle = AXLES[nuisance.at[0] - own.start] if pair and len(nuisance.at) == 1 else ""
    if name == _AREA:
        factor = _brake_gain_per_area(vehicle.p, AXLES.index(axle))
        what = PARAMETERS["brake_gain"]
        return Quantity(f"brake_gain_{axle}_nm_pa", what, "N m/Pa", axle, lambda area: factor * area)
    if name == _COG:
        return Quantity("cog_to_front_axle_m", PARAMETERS[name], "m", "", _same)
    key, factor = _preferred_key(name, axle, pair)
    unit = DERIVED_UNITS.get(key, _units().get(name, ""))
    what = PARAMETERS.get(name, name.replace("_", " "))
    return Quantity(key, what, unit, axle, lambda value: value / factor)


def _preferred_key(name: str, axle: str, pair: bool) -> tuple[str, float]:
    """Key of a parameter of the plant, and how many times its value the parameter is."""
    for key, (parameter, member, factor) in DERIVED.items():
        if parameter == name and member is not None and (not pair or AXLES[member] == axle):
            return key, factor
    shorts = [short for short, flat in ALIASES.items() if flat == name]
    return next((one for one in shorts if name.endswith(one)), shorts[0] if shorts else name), 1.0


def _of_theta(nuisance: Nuisance) -> Quantity:
    effect, parameter, member = _effect_parameters()[nuisance.at[0]]
    what = IN_THETA.get((effect, parameter), THETA.effect(effect).title)
    unit = THETA.effect(effect).parameter(parameter).unit
    location = _PLACES.get(member, member) if len(nuisance.at) == 1 and member != "car" else ""
    if nuisance.kind is NuisanceKind.LINE_LAG:
        return Quantity(LINE, what, unit, location, _same, False)
    has_key = nuisance.kind is NuisanceKind.SENSOR and not nuisance.name.startswith("zero_")
    return Quantity(nuisance.name if has_key else "", what, unit, location, _same, False)


def _brake_gain_per_area(p: Floats, axle: int) -> float:
    """Brake gain at the temperature it is stated at (`hil.diagnosis.vehicle.spec.with_gains`) per piston area."""
    epsilon = float(p[P.pad_epsilon_w])
    temperature = float(p[P.friction_brake_ambient_k]) if epsilon >= CONSTANT_EPSILON_W else BRAKE_K
    mu = mu_equilibrium(0.0, temperature, float(p[P.pad_a_1_ks]), float(p[P.pad_b_1_j]), epsilon)
    return float(2.0 * mu * p[P.friction_brake_efficiency] * p[PARAMETER.slice(_RADIUS)][axle])


def _same(value: float) -> float:
    return value


def _rows_to_s(squared_rows: float) -> float:
    return _ROW_S * float(np.sqrt(max(squared_rows, 0.0)))


@cache
def _parameter(at: int) -> str:
    """Name of the plant's parameter at an index."""
    return next(name for name in PARAMETER.sizes if PARAMETER.slice(name).start <= at < PARAMETER.slice(name).stop)


@cache
def _effect_parameters() -> dict[int, tuple[str, str, str]]:
    """Effect, parameter and member by index in theta."""
    return {
        THETA.slice(effect.name, parameter.name).start + k: (effect.name, parameter.name, member)
        for effect in THETA.effects
        for parameter in effect.parameters
        for k, member in enumerate(effect.scope.members[: parameter.size(effect.scope)])
    }


@cache
def _units() -> dict[str, str]:
    """Units of the plant's parameters by flat name."""
    shipped = (resources.files("plant") / "parameters" / "paper_car.toml").read_text(encoding="utf-8")
    return {
        f"{section}_{name}": str(entry["unit"])
        for section, entries in tomllib.loads(shipped).items()
        for name, entry in entries.items()
        if isinstance(entry, dict)
    }

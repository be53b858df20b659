"""Vehicle sets: files and mappings into a parameter vector and its tolerances."""

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.keys import (
    ALIASES,
    DERIVED,
    LATENCY,
    LATENCY_S,
    LINE,
    LINE_S,
    SPECIAL,
    UNLIMITED,
    WIDE,
)
from hil.diagnosis.vehicle.priors import Nuisance, nuisance_parameters, with_wide_prior
from hil.diagnosis.vehicle.side_to_side import line_lag, side_to_side_variation
from hil.diagnosis.vehicle.spec import Vehicle, with_constant_friction, with_gains
from hil.scenario.parameters import ParameterError, is_number, load_set, override
from plant.model import pack
from plant.parameters.plant import PlantParameters
from plant.vectors import PARAMETER

_SHIPPED = resources.files("plant") / "parameters" / "paper_car.toml"
_STATED = 0.01
"""Half width of what is stated without one, as a share."""
_SECTIONS = (
    "friction_brake", "vehicle", "suspension", "wheel", "tyre", "ehb", "pad", "motor", "battery", "sensor",
)  # fmt: skip
_THRESHOLD = "friction_brake_threshold_pressure_pa"
_BALANCE = 0.3
"""Half width of what an axle's cornering stiffness may be off beside the other's, where nobody states the tyres'."""
_BRAKES, _MOTORS = "suspension_brake_support_tangent", "suspension_drive_support_tangent"
_KNOWN = sorted({*ALIASES, *DERIVED, *SPECIAL, *PARAMETER.sizes})
_FORMS = ("tyre_", "suspension_")
"""Sections whose curves hardly a set states: what it does not say may go as far as any guess."""
_HALVES = (f"{LATENCY}_tolerance", f"{LINE}_tolerance")
"""Half-widths of what no set gives a value of."""
_THEN = {
    "ehb": "pressures are compared only where none has been asked for a while, and left and right where the same is",
    "motor": "torques of the motors are not compared with what is asked of them",
}
"""What follows where a set says nothing of a section."""


@dataclass(frozen=True, eq=False)
class _Stated:
    """What a set says: numbers by the plant's flat names, half widths of some, and what it says that is odd."""

    numbers: dict[str, Any] = field(default_factory=dict)
    tolerances: dict[str, float] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    @property
    def names(self) -> set[str]:
        """Names of its numbers, of both axles."""
        return {_of_both(name) for name in self.numbers}

    def widen(self, name: str, half: float) -> None:
        self.tolerances[name] = max(self.tolerances.get(name, 0.0), half)


def paper_car() -> Vehicle:
    """The shipped set with its own tolerances."""
    parameters = load_set(_SHIPPED, PlantParameters)
    return _vehicle(parameters, _shipped_tolerances(), True, (), ())


def load_vehicle(source: Path | Mapping[str, Any] | None) -> Vehicle:
    """A flat TOML of SI numbers (or such a mapping); None is the shipped set. See `hil.diagnosis.vehicle.keys`.

    Raises
    ------
    UnusableError
        Not TOML, or a value that is no number or that no car has.
    """
    if source is None:
        return paper_car()
    where = str(source) if isinstance(source, Path) else "vehicle"
    table = _read(source) if isinstance(source, Path) else dict(source)
    if "vehicle" in table and isinstance(table["vehicle"], Mapping) and "mass_kg" in table["vehicle"]:
        table = dict(table["vehicle"])
    return _from_flat(table, where)


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not a vehicle set: {error}") from error


def _shipped_tolerances() -> dict[str, float]:
    return {
        f"{section}_{name}": float(entry["tolerance"])
        for section, entries in tomllib.loads(_SHIPPED.read_text(encoding="utf-8")).items()
        for name, entry in entries.items()
        if isinstance(entry, Mapping)
    }


def _from_flat(table: Mapping[str, Any], where: str) -> Vehicle:
    base = paper_car().parameters
    stated = _stated(table, where, base)
    changes, gains = _changes(stated.numbers, base, where)
    unstated = tuple(section for section in UNLIMITED if section not in changes)
    unlimited = _without_limits(changes)
    try:
        parameters = override(base, changes, where)
    except ParameterError as error:
        raise UnusableError(str(error)) from error
    friction = any(name.startswith("pad_") for name in stated.numbers)
    if gains and not friction:
        parameters = with_constant_friction(parameters)
    if gains:
        parameters = with_gains(parameters, gains)
    missing = [name for name in WIDE if name not in stated.names]
    tolerance = _tolerance(stated, parameters, gains, missing, unlimited)
    remarks = (*stated.remarks, *_left_open(where, unlimited, unstated, missing))
    vehicle = _vehicle(parameters, tolerance, friction or not gains, remarks, stated.names)
    told = stated.names | {_of_both(name) for name in stated.tolerances}
    nuisances = tuple(
        with_wide_prior(one, vehicle.p)
        if _of_both(one.name) in missing or (one.name.startswith(_FORMS) and _of_both(one.name) not in told)
        else one
        for one in vehicle.nuisances
    )
    if is_number(stated.numbers.get(_THRESHOLD)):
        nuisances = _as_one(nuisances, _THRESHOLD)
    if unlimited:  # who states every limit has measured the rest as well
        nuisances = (*nuisances, *side_to_side_variation(vehicle.p, motors="motor" not in unstated))
    nuisances = (*nuisances, *line_lag(stated.tolerances.get(LINE, LINE_S)))
    sprung = {name for name in PARAMETER.sizes if name.startswith("suspension_")} <= stated.names
    return replace(
        vehicle, nuisances=nuisances, unstated=unstated, unlimited=unlimited, suspension_stated=sprung,
        node_latency_s=stated.tolerances.get(LATENCY, LATENCY_S),
    )  # fmt: skip


def _stated(table: Mapping[str, Any], where: str, base: PlantParameters) -> _Stated:
    stated = _Stated()
    for key, value in table.items():
        stem = key.removesuffix("_tolerance")
        if stem in DERIVED and isinstance(value, int | float):
            _derive(stem, float(value), key != stem, base, stated)
            continue
        name = ALIASES.get(stem, stem)
        if name not in SPECIAL and name not in PARAMETER.sizes and key not in _HALVES:
            if not isinstance(value, str):
                near = get_close_matches(stem, _KNOWN, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                stated.remarks.append(f"{where}: unknown key {key!r} is left out{hint}")
            continue
        given = _number(value, f"{where}: {key}")
        if key != stem:
            stated.widen(name, max(given if isinstance(given, list) else [given]))
        elif isinstance(given, list) and not _by_axle(name, base):
            mean, apart = float(np.mean(given)), 0.5 * float(np.ptp(given))
            stated.numbers[name] = mean
            stated.widen(name, apart)
            stated.remarks.append(f"{where}: {key} is one number of the car: {mean:g} is taken, {apart:g} more or less")
        else:
            stated.numbers[name] = given
    if _BRAKES in stated.numbers:  # a hub carrier takes up the torque of a motor in the wheel as it does a caliper's
        stated.numbers.setdefault(_MOTORS, stated.numbers[_BRAKES])
        stated.tolerances.setdefault(_MOTORS, stated.tolerances.get(_BRAKES, 0.0))
    return stated


def _without_limits(changes: dict[str, Any]) -> tuple[str, ...]:
    """Limits that ``changes`` do not state, which are put out of reach in them."""
    unlimited: list[str] = []
    for section, limits in UNLIMITED.items():
        for together in limits:
            stated = changes.setdefault(section, {})
            if not together.keys() & stated.keys():
                stated.update(together)
                unlimited += [f"{section}_{name}" for name in together]
    return tuple(unlimited)


def _tolerance(
    stated: _Stated, parameters: PlantParameters, gains: Mapping[str, float], missing: Sequence[str],
    unlimited: Sequence[str],
) -> dict[str, float]:  # fmt: skip
    """Half widths of all numbers: as stated, a hundredth of what is stated without, wide of what is missing."""
    shipped = {name: half for name, half in _shipped_tolerances().items() if name not in unlimited}
    tolerance = {name: shipped.get(name, 0.0) for name in PARAMETER.sizes}
    for name in stated.names & set(PARAMETER.sizes) - stated.tolerances.keys():
        tolerance[name] = min(tolerance[name], _STATED * _largest(parameters, name))
    tolerance |= {f"brake_gain_{axle}": _STATED * gain for axle, gain in gains.items()}
    for name in missing:
        tolerance[name] = max(tolerance[name], WIDE[name] * _largest(parameters, name))
    if "tyre_lky" in missing:
        tolerance["vehicle_slip_angle_share"] = max(tolerance["vehicle_slip_angle_share"], _BALANCE)
    return tolerance | {
        name: max(half, shipped.get(name, 0.0)) if name.startswith("suspension") and name not in stated.names else half
        for name, half in stated.tolerances.items()
    }


def _left_open(where: str, unlimited: Sequence[str], unstated: Sequence[str], missing: Sequence[str]) -> list[str]:
    """Remarks on what a set does not say."""
    remarks = []
    if unlimited:
        remarks.append(f"{where}: not given, so no such limit is simulated: {', '.join(unlimited)}")
    if unstated:
        follows = "".join(f"; {_THEN[section]}" for section in unstated if section in _THEN)
        remarks.append(f"{where}: nothing said of {', '.join(unstated)}{follows}")
    if missing:
        remarks.append(f"{where}: not given, so a usual value with wide uncertainty: {', '.join(missing)}")
    return remarks


def _of_both(name: str) -> str:
    """A number's name without its axle."""
    return name.removesuffix("_front").removesuffix("_rear")


def _as_one(nuisances: tuple[Nuisance, ...], name: str) -> tuple[Nuisance, ...]:
    """A number of each axle that is stated once is one number."""
    front, rear = (one for one in nuisances if one.name.startswith(name))
    both = replace(front, name=name, at=front.at + rear.at, step=front.step + rear.step)
    return tuple(both if one is front else one for one in nuisances if one is not rear)


def _derive(key: str, value: float, is_tolerance: bool, base: PlantParameters, stated: _Stated) -> None:
    """A number that is one of a pair, or a multiple, of one of the plant's."""
    name, place, factor = DERIVED[key]
    if is_tolerance:
        stated.widen(name, value * factor)
    elif place is not None:
        now = stated.numbers.get(name, _value(base, name))
        changed = list(now) if isinstance(now, list | tuple) else [now]
        changed[place] = value * factor
        stated.numbers[name] = changed if isinstance(now, list | tuple) else changed[0]


def _by_axle(name: str, base: PlantParameters) -> bool:
    """Whether a number of the plant stands once for each axle."""
    return name in PARAMETER.sizes and isinstance(_value(base, name), tuple)


def _number(value: Any, where: str) -> Any:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(map(is_number, numbers)):
        raise UnusableError(f"{where}: expected a number, got {value!r}")
    return value


def _value(parameters: PlantParameters, flat: str) -> Any:
    section, name = _place(flat)
    return getattr(getattr(parameters, section), name)


def _largest(parameters: PlantParameters, flat: str) -> float:
    """Size of a number, the largest of both axles'."""
    return float(np.max(np.abs(np.asarray(_value(parameters, flat)))))


def _place(flat: str) -> tuple[str, str]:
    """Section of a parameter by its flat name, and its name there."""
    section = next(s for s in _SECTIONS if flat.startswith(f"{s}_"))
    return section, flat.removeprefix(f"{section}_")


def _changes(numbers: Mapping[str, Any], base: PlantParameters, where: str) -> tuple[dict[str, Any], dict[str, float]]:
    """Nested changes of the set, and the brake gains (N m per Pa and wheel)."""
    numbers = dict(numbers)
    gains = {
        axle: float(numbers.pop(f"brake_gain_{axle}")) for axle in ("front", "rear") if f"brake_gain_{axle}" in numbers
    }
    wheelbase = float(numbers.pop("wheelbase_m", sum(base.vehicle.cog_to_axle_m)))
    front = numbers.pop("cog_to_front_axle_m", None)
    rear = numbers.pop("cog_to_rear_axle_m", None)
    share = numbers.pop("front_weight_share", None)
    if front is None:
        usual = base.vehicle.cog_to_axle_m[0] / sum(base.vehicle.cog_to_axle_m)
        front = wheelbase - rear if rear is not None else wheelbase * (1.0 - share if share is not None else usual)
    if not 0.0 < front < wheelbase:
        raise UnusableError(f"{where}: the centre of gravity lies {front:g} m behind the front axle of {wheelbase:g} m")
    flat = {"vehicle_cog_to_axle_m": [float(front), wheelbase - float(front)]} | {
        name: value for name, value in numbers.items() if name in PARAMETER.sizes
    }
    changes: dict[str, Any] = {}
    for name, value in flat.items():
        now = _value(base, name)
        if isinstance(now, tuple) and not isinstance(value, list):
            value = [float(value)] * len(now)
        section, short = _place(name)
        changes.setdefault(section, {})[short] = value
    return changes, gains


def _vehicle(
    parameters: PlantParameters, tolerance: Mapping[str, float], thermal: bool, remarks: tuple[str, ...],
    stated: Collection[str],
) -> Vehicle:  # fmt: skip
    p = pack(parameters)
    return Vehicle(parameters, p, tuple(nuisance_parameters(p, tolerance, PARAMETER, stated)), thermal, remarks)

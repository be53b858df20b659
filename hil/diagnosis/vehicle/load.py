"""Vehicle sets: files and mappings into the parameters of a car and their tolerances."""

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.channel_map import refuse_question_marks
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.bounds import refuse_implausible
from hil.diagnosis.vehicle.checks import (
    check_bounds,
    check_order,
    checked_number,
    checked_numbers,
    checked_tolerance,
)
from hil.diagnosis.vehicle.key_names import missing_keys, stated_keys
from hil.diagnosis.vehicle.keys import (
    ALIASES,
    AXLES,
    DERIVED,
    LINE,
    LINE_S,
    LUMPED,
    SPECIAL,
    UNLIMITED,
    WIDE,
    split_name,
)
from hil.diagnosis.vehicle.latency import ALL_NODES, LATENCY_KEYS, latencies
from hil.diagnosis.vehicle.priors import (
    INSTRUMENTS,
    Nuisance,
    NuisanceKind,
    instruments,
    line_lag,
    nuisance_parameters,
    side_to_side_variation,
    with_wide_prior,
)
from hil.diagnosis.vehicle.spec import Vehicle, with_constant_friction, with_gains
from hil.errors import in_words
from hil.scenario.parameters import is_number, load_set, override
from plant.model import pack
from plant.parameters.plant import PlantParameters
from plant.vectors import PARAMETER

_SHIPPED = resources.files("plant") / "parameters" / "paper_car.toml"
_STATED = 0.01
"""Half-width of a stated parameter without a tolerance, as a share."""
_THRESHOLD = "friction_brake_threshold_pressure_pa"
_BALANCE = 0.3
"""Half-width of an axle's cornering stiffness beside the other axle's, where the set does not state the tyres'."""
_GRIP_UNSTATED = {"tyre_partial_sliding": 0.5, "tyre_pdx2": 0.16}
"""Half-widths where the set does not state the tyres' friction. Partial sliding: brush 0.38, exponential 0.57
(`plant.tyre.partly_sliding`). Friction over the load: from none to twice that of the shipped tyre."""
_BRAKES, _MOTORS = "suspension_brake_support_tangent", "suspension_drive_support_tangent"
_KNOWN = sorted({*ALIASES, *DERIVED, *SPECIAL, *LATENCY_KEYS, *PARAMETER.sizes})
_FORMS = ("tyre_", "suspension_")
"""Sections with curves that hardly a set states: what it does not state gets a wide prior."""
_IN_BRAKE_GAIN = ("friction_brake_piston_area_m2", "friction_brake_effective_radius_m", "friction_brake_efficiency")
"""Parameters whose tolerance is part of the brake gains'."""
_TOLERANCES_ONLY = tuple(f"{key}_tolerance" for key in (ALL_NODES, LINE, *INSTRUMENTS))
"""Keys of parameters that have a tolerance and no value."""
_CONSEQUENCES = {
    "ehb": "pressures are compared only where their demand has been zero for a while, and left with right where the "
    "demands are equal",
    "motor": "torques of the motors are not compared with their demands",
}
"""What follows where a set does not state a section."""


@dataclass(frozen=True, eq=False)
class _Stated:
    """Content of a set: values and half-widths by flat name, and remarks on what is unusual in it."""

    values: dict[str, Any] = field(default_factory=dict)
    tolerances: dict[str, float] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    one_axle: set[str] = field(default_factory=set)
    """Names with their axle, of values and half-widths that are stated for one axle alone."""

    @property
    def names(self) -> set[str]:
        """Names of the stated values, without the axle."""
        return {_without_axle(name) for name in self.values}

    @property
    def known(self) -> set[str]:
        """Names of the stated values, with the axle where one axle alone is stated."""
        return (self.names - {_without_axle(name) for name in self.one_axle}) | self.one_axle

    @property
    def exact(self) -> set[str]:
        """Names of a stated tolerance of zero."""
        return {name for name, half in self.tolerances.items() if half == 0.0}

    def widen(self, name: str, half_width: float) -> None:
        self.tolerances[name] = max(self.tolerances.get(name, 0.0), half_width)


def paper_car() -> Vehicle:
    """The shipped vehicle set with its own tolerances."""
    return _vehicle(_shipped_parameters(), _shipped_tolerances(), True, (), ())


def load_vehicle(source: Path | Mapping[str, Any] | None) -> Vehicle:
    """A flat TOML file (or mapping) of SI values; None is the shipped set. Keys: `hil.diagnosis.vehicle.keys`.

    Raises
    ------
    UnusableError
        Not TOML; a value that is not a number, or out of bounds; a key of the list ``required`` without a number.
    """
    if source is None:
        return paper_car()
    where = str(source) if isinstance(source, Path) else "vehicle"
    table = read_set(source) if isinstance(source, Path) else _flattened(source)
    missing = missing_keys(table)
    table.pop("required", None)
    if missing:
        raise UnusableError(
            f"{where}: not finished: no number yet of {', '.join(missing)}; fill them in from the car's sheet (key = "
            "number, in SI units)"
        )
    return replace(_from_flat(table, where), stated=stated_keys(table))


def read_set(path: Path) -> dict[str, Any]:
    """A vehicle set as written.

    Raises
    ------
    UnusableError
        Not TOML, or a draft with a question mark.
    """
    try:
        text = path.read_text(encoding="utf-8")
        refuse_question_marks(path, text)
        return _flattened(tomllib.loads(text))
    except (OSError, ValueError) as error:
        raise UnusableError(f"{path}: not a vehicle set: {in_words(error)}") from error


def _flattened(table: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a set, whether they stand in a table ``[vehicle]`` or not."""
    inner = table.get("vehicle")
    return dict(inner if isinstance(inner, Mapping) and "mass_kg" in inner else table)


@cache
def _shipped_parameters() -> PlantParameters:
    return load_set(_SHIPPED, PlantParameters)


@cache
def _shipped_tolerances() -> Mapping[str, float]:
    return {
        f"{section}_{name}": float(entry["tolerance"])
        for section, entries in tomllib.loads(_SHIPPED.read_text(encoding="utf-8")).items()
        for name, entry in entries.items()
        if isinstance(entry, Mapping)
    }


def _from_flat(table: Mapping[str, Any], where: str) -> Vehicle:
    base = _shipped_parameters()
    stated = _stated(table, where, base)
    changes, gains = _changes(stated.values, base, where)
    unstated = tuple(section for section in UNLIMITED if section not in changes)
    unlimited = _without_limits(changes)
    parameters = override(base, changes, where)
    check_order(parameters, where)
    friction = any(name.startswith("pad_") for name in stated.values)
    if gains and not friction:
        parameters = with_constant_friction(parameters)
    if gains:
        parameters = with_gains(parameters, gains)
    missing = [name for name in WIDE if name not in stated.names | stated.exact]
    tolerance = _tolerance(stated, parameters, gains, missing, unlimited)
    if gains and not friction:  # one constant, which the gains contain
        tolerance |= {name: 0.0 for name in tolerance if name.startswith("pad_")}
    remarks = (*stated.remarks, *_remarks_on_missing(where, unlimited, unstated, missing))
    vehicle = _vehicle(parameters, tolerance, friction or not gains, remarks, stated.known, stated.exact)
    known = stated.names | {_without_axle(name) for name in stated.tolerances}
    nuisances = tuple(
        with_wide_prior(one, vehicle.p)
        if _without_axle(one.name) in missing or (one.name.startswith(_FORMS) and _without_axle(one.name) not in known)
        else one
        for one in vehicle.nuisances
    )
    if is_number(stated.values.get(_THRESHOLD)):
        nuisances = _merge_axles(nuisances, _THRESHOLD)
    if unlimited:  # a set with every limit is from measurements, also of each wheel
        nuisances = (*nuisances, *side_to_side_variation(vehicle.p, motors="motor" not in unstated))
    nuisances = (*nuisances, *instruments(stated.tolerances, not unlimited, motors="motor" not in unstated))
    nuisances = (*nuisances, *line_lag(stated.tolerances.get(LINE, LINE_S)))
    vehicle = replace(vehicle, remarks=(*vehicle.remarks, *_remark_on_unused(where, stated, nuisances)))
    suspension = {name for name in PARAMETER.sizes if name.startswith("suspension_")}
    return replace(
        vehicle, nuisances=nuisances, unstated=unstated, unlimited=unlimited,
        suspension_stated=suspension <= stated.names,
        latencies=latencies(stated.values, stated.tolerances, measured=not unlimited),
    )  # fmt: skip


def _stated(table: Mapping[str, Any], where: str, base: PlantParameters) -> _Stated:
    stated = _Stated()
    for key, value in table.items():
        stem = key.removesuffix("_tolerance")
        if stem in DERIVED:
            number = checked_number(value, key, where)
            if key == stem:
                refuse_implausible(where, key, DERIVED[stem][0], number, DERIVED[stem][2])
            _derive(stem, number, key != stem, base, stated, where)
            continue
        name = ALIASES.get(stem, stem)
        known = name in SPECIAL or name in PARAMETER.sizes or name in LATENCY_KEYS
        if not known and key not in _TOLERANCES_ONLY:
            if not isinstance(value, str):
                near = get_close_matches(stem, _KNOWN, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                stated.remarks.append(f"{where}: unknown key {key!r} is left out{hint}")
            continue
        if key != stem:
            most = PARAMETER.sizes.get(name, 1)
            given = table.get(stem)
            stated.widen(name, checked_tolerance(value, key, where, len(given) if isinstance(given, list) else most))
            continue
        given = checked_numbers(value, key, where)
        refuse_implausible(where, key, name, given)
        check_bounds(base, name, key, float(np.mean(given)) if not _by_axle(name, base) else given, where)
        if isinstance(given, list) and not _by_axle(name, base):
            mean, half_width = float(np.mean(given)), 0.5 * float(np.ptp(given))
            stated.values[name] = mean
            if half_width > 0.0:
                stated.widen(name, half_width)
            stated.remarks.append(f"{where}: {key} is one value per car: the mean {mean:g} +/- {half_width:g} is taken")
        else:
            stated.values[name] = given
            stated.one_axle.difference_update(f"{name}_{axle}" for axle in AXLES)
    for name in {_without_axle(one) for one in stated.one_axle}:  # the larger of two axles' counts, as of a list
        halves = [stated.tolerances.get(f"{name}_{axle}", 0.0) for axle in AXLES]
        if min(halves) > 0.0:
            stated.tolerances.update((f"{name}_{axle}", max(halves)) for axle in AXLES)
    if _BRAKES in stated.values:  # a hub carrier takes up the torque of a motor in the wheel as it does a caliper's
        stated.values.setdefault(_MOTORS, stated.values[_BRAKES])
        stated.tolerances.setdefault(_MOTORS, stated.tolerances.get(_BRAKES, 0.0))
    return stated


def _without_limits(changes: dict[str, Any]) -> tuple[str, ...]:
    """Names of the limits that ``changes`` do not state; they are put out of reach in ``changes``."""
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
    """Half-widths of all parameters: as stated, 1 % of a value stated without one, wide for missing values."""
    shipped = {name: half for name, half in _shipped_tolerances().items() if name not in unlimited}
    tolerance = {name: shipped.get(name, 0.0) for name in PARAMETER.sizes}
    for name in stated.known - stated.tolerances.keys():
        whole = _without_axle(name)
        if whole in PARAMETER.sizes:
            tolerance[name] = min(tolerance[whole], _STATED * _largest(parameters, whole))
    tolerance |= {f"brake_gain_{axle}": _STATED * gain for axle, gain in gains.items()}
    for name in missing:
        tolerance[name] = max(tolerance[name], WIDE[name] * _largest(parameters, name))
    if "tyre_lmux" in missing:
        tolerance |= {name: half for name, half in _GRIP_UNSTATED.items() if name not in stated.names}
    if "tyre_lky" in missing:
        tolerance["vehicle_slip_angle_share"] = max(tolerance["vehicle_slip_angle_share"], _BALANCE)
    tolerance |= {
        name: max(half, shipped.get(name, 0.0)) if name.startswith("suspension") and name not in stated.names else half
        for name, half in stated.tolerances.items()
    }
    if unlimited:
        tolerance |= {name: max(tolerance[name], share * _largest(parameters, name)) for name, share in LUMPED.items()}
    return tolerance


def _remarks_on_missing(
    where: str, unlimited: Sequence[str], unstated: Sequence[str], missing: Sequence[str]
) -> list[str]:
    """Remarks on what a set does not state."""
    remarks = []
    if unlimited:
        remarks.append(f"{where}: not given, so no such limit is simulated: {', '.join(unlimited)}")
    if unstated:
        follows = "".join(f"; {_CONSEQUENCES[section]}" for section in unstated if section in _CONSEQUENCES)
        remarks.append(f"{where}: not given: {', '.join(unstated)}{follows}")
    if missing:
        remarks.append(f"{where}: not given, so the shipped value with a wide prior: {', '.join(missing)}")
    return remarks


def _remark_on_unused(where: str, stated: _Stated, nuisances: Sequence[Nuisance]) -> list[str]:
    """Remark on tolerances that no fit uses: of numbers that the logs of a car hardly show."""
    moved = {at for one in nuisances if one.kind in (NuisanceKind.VEHICLE, NuisanceKind.SIGNED) for at in one.at}
    unused = []
    for name, half in stated.tolerances.items():
        whole = _without_axle(name)
        own = PARAMETER.slice(whole) if whole in PARAMETER.sizes else None
        fixed = name == "wheelbase_m" if own is None else moved.isdisjoint(range(own.start, own.stop))
        if half and fixed and name not in _IN_BRAKE_GAIN:
            unused.append(name)
    return [f"{where}: kept as stated whatever their tolerance: {', '.join(unused)}"] if unused else []


def _without_axle(name: str) -> str:
    """Name of a parameter without its axle."""
    return name.removesuffix("_front").removesuffix("_rear")


def _merge_axles(nuisances: tuple[Nuisance, ...], name: str) -> tuple[Nuisance, ...]:
    """Nuisances of both axles of a parameter as one: the set states one value for both."""
    axles = [one for one in nuisances if one.name.startswith(name)]
    if len(axles) < len(AXLES):  # known exactly
        return nuisances
    front, rear = axles
    both = replace(front, name=name, at=front.at + rear.at, step=front.step + rear.step)
    return tuple(both if one is front else one for one in nuisances if one is not rear)


def _derive(key: str, value: float, is_tolerance: bool, base: PlantParameters, stated: _Stated, where: str) -> None:
    """Add a key that is one member, or a multiple, of a parameter of the plant to ``stated``."""
    name, member, factor = DERIVED[key]
    of_axle = f"{name}_{AXLES[member]}" if member is not None and _by_axle(name, base) else name
    if is_tolerance:
        half = checked_tolerance(value, f"{key}_tolerance", where) * factor
        if half or member is not None:  # a value that is not taken cannot be known exactly
            stated.widen(of_axle, half)
    elif member is not None:
        now = stated.values.get(name, _value(base, name))
        changed = list(now) if isinstance(now, list | tuple) else [now]
        changed[member] = value * factor
        check_bounds(base, name, key, changed if _by_axle(name, base) else changed[0], where)
        if of_axle != name and (name not in stated.values or {f"{name}_{axle}" for axle in AXLES} & stated.one_axle):
            stated.one_axle.add(of_axle)
        stated.values[name] = changed if isinstance(now, list | tuple) else changed[0]


def _by_axle(name: str, base: PlantParameters) -> bool:
    """Whether the plant has a value of the parameter per axle."""
    return name in PARAMETER.sizes and isinstance(_value(base, name), tuple)


def _value(parameters: PlantParameters, flat: str) -> Any:
    section, name = split_name(flat)
    return getattr(getattr(parameters, section), name)


def _largest(parameters: PlantParameters, flat: str) -> float:
    """Size of a parameter, the larger of both axles."""
    return float(np.max(np.abs(np.asarray(_value(parameters, flat)))))


def _changes(stated: Mapping[str, Any], base: PlantParameters, where: str) -> tuple[dict[str, Any], dict[str, float]]:
    """Changes to ``base``, by section and name, and the brake gains (N m per Pa and wheel) by axle."""
    values = dict(stated)
    gains = {
        axle: float(values.pop(f"brake_gain_{axle}")) for axle in ("front", "rear") if f"brake_gain_{axle}" in values
    }
    wheelbase = float(values.pop("wheelbase_m", sum(base.vehicle.cog_to_axle_m)))
    front = values.pop("cog_to_front_axle_m", None)
    rear = values.pop("cog_to_rear_axle_m", None)
    share = values.pop("front_weight_share", None)
    if front is None:
        default = base.vehicle.cog_to_axle_m[0] / sum(base.vehicle.cog_to_axle_m)
        front = wheelbase - rear if rear is not None else wheelbase * (1.0 - share if share is not None else default)
    for key, other in (("cog_to_rear_axle_m", rear), ("front_weight_share", share)):
        implied = wheelbase - front if other is rear else 1.0 - front / wheelbase
        if other is not None and abs(other - implied) > _STATED * max(abs(implied), abs(other)):
            raise UnusableError(
                f"{where}: {key}: expected {implied:.4g}, as the other keys give, got {other:.4g}; state one of them"
            )
    if not 0.0 < front < wheelbase:
        keys = ", ".join(key for key in stated if key in SPECIAL and not key.startswith("brake_gain"))
        raise UnusableError(
            f"{where}: {keys}: expected a centre of gravity 0 to {wheelbase:g} m behind the front axle, got "
            f"{front:g} m; measure both from the front axle"
        )
    between = [float(front), wheelbase - float(front)]
    check_bounds(base, "vehicle_cog_to_axle_m", "cog_to_front_axle_m and wheelbase_m", between, where)
    flat = {"vehicle_cog_to_axle_m": between} | {
        name: value for name, value in values.items() if name in PARAMETER.sizes
    }
    changes: dict[str, Any] = {}
    for name, value in flat.items():
        now = _value(base, name)
        if isinstance(now, tuple) and not isinstance(value, list):
            value = [float(value)] * len(now)
        section, short = split_name(name)
        changes.setdefault(section, {})[short] = value
    return changes, gains


def _vehicle(
    parameters: PlantParameters, tolerance: Mapping[str, float], thermal: bool, remarks: tuple[str, ...],
    stated: Collection[str], exact: Collection[str] = (),
) -> Vehicle:  # fmt: skip
    p = pack(parameters)
    return Vehicle(parameters, p, tuple(nuisance_parameters(p, tolerance, stated, exact)), thermal, remarks)

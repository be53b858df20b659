"""Vehicle sets: files and mappings into the parameters of a car and their tolerances."""

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
    split_name,
)
from hil.diagnosis.vehicle.priors import (
    Nuisance,
    line_lag,
    nuisance_parameters,
    side_to_side_variation,
    with_wide_prior,
)
from hil.diagnosis.vehicle.spec import Vehicle, with_constant_friction, with_gains
from hil.scenario.parameters import ParameterError, is_number, load_set, override
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
_KNOWN = sorted({*ALIASES, *DERIVED, *SPECIAL, *PARAMETER.sizes})
_FORMS = ("tyre_", "suspension_")
"""Sections with curves that hardly a set states: what it does not state gets a wide prior."""
_TOLERANCES_ONLY = (f"{LATENCY}_tolerance", f"{LINE}_tolerance")
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

    @property
    def names(self) -> set[str]:
        """Names of the stated values, without the axle."""
        return {_without_axle(name) for name in self.values}

    def widen(self, name: str, half_width: float) -> None:
        self.tolerances[name] = max(self.tolerances.get(name, 0.0), half_width)


def paper_car() -> Vehicle:
    """The shipped vehicle set with its own tolerances."""
    parameters = load_set(_SHIPPED, PlantParameters)
    return _vehicle(parameters, _shipped_tolerances(), True, (), ())


def load_vehicle(source: Path | Mapping[str, Any] | None) -> Vehicle:
    """A flat TOML file (or mapping) of SI values; None is the shipped set. Keys: `hil.diagnosis.vehicle.keys`.

    Raises
    ------
    UnusableError
        Not TOML; a value that is not a number, or out of bounds.
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
    changes, gains = _changes(stated.values, base, where)
    unstated = tuple(section for section in UNLIMITED if section not in changes)
    unlimited = _without_limits(changes)
    try:
        parameters = override(base, changes, where)
    except ParameterError as error:
        raise UnusableError(str(error)) from error
    friction = any(name.startswith("pad_") for name in stated.values)
    if gains and not friction:
        parameters = with_constant_friction(parameters)
    if gains:
        parameters = with_gains(parameters, gains)
    missing = [name for name in WIDE if name not in stated.names]
    tolerance = _tolerance(stated, parameters, gains, missing, unlimited)
    if gains and not friction:  # one constant, which the gains contain
        tolerance |= {name: 0.0 for name in tolerance if name.startswith("pad_")}
    remarks = (*stated.remarks, *_remarks_on_missing(where, unlimited, unstated, missing))
    vehicle = _vehicle(parameters, tolerance, friction or not gains, remarks, stated.names)
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
    nuisances = (*nuisances, *line_lag(stated.tolerances.get(LINE, LINE_S)))
    suspension = {name for name in PARAMETER.sizes if name.startswith("suspension_")}
    return replace(
        vehicle, nuisances=nuisances, unstated=unstated, unlimited=unlimited,
        suspension_stated=suspension <= stated.names, node_latency_s=stated.tolerances.get(LATENCY, LATENCY_S),
    )  # fmt: skip


def _stated(table: Mapping[str, Any], where: str, base: PlantParameters) -> _Stated:
    stated = _Stated()
    for key, value in table.items():
        stem = key.removesuffix("_tolerance")
        if stem in DERIVED and isinstance(value, int | float):
            _derive(stem, float(value), key != stem, base, stated)
            continue
        name = ALIASES.get(stem, stem)
        if name not in SPECIAL and name not in PARAMETER.sizes and key not in _TOLERANCES_ONLY:
            if not isinstance(value, str):
                near = get_close_matches(stem, _KNOWN, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                stated.remarks.append(f"{where}: unknown key {key!r} is left out{hint}")
            continue
        given = _number(value, f"{where}: {key}")
        if key != stem:
            stated.widen(name, max(given if isinstance(given, list) else [given]))
        elif isinstance(given, list) and not _by_axle(name, base):
            mean, half_width = float(np.mean(given)), 0.5 * float(np.ptp(given))
            stated.values[name] = mean
            stated.widen(name, half_width)
            stated.remarks.append(f"{where}: {key} is one value per car: the mean {mean:g} +/- {half_width:g} is taken")
        else:
            stated.values[name] = given
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
    for name in stated.names & set(PARAMETER.sizes) - stated.tolerances.keys():
        tolerance[name] = min(tolerance[name], _STATED * _largest(parameters, name))
    tolerance |= {f"brake_gain_{axle}": _STATED * gain for axle, gain in gains.items()}
    for name in missing:
        tolerance[name] = max(tolerance[name], WIDE[name] * _largest(parameters, name))
    if "tyre_lmux" in missing:
        tolerance |= {name: half for name, half in _GRIP_UNSTATED.items() if name not in stated.names}
    if "tyre_lky" in missing:
        tolerance["vehicle_slip_angle_share"] = max(tolerance["vehicle_slip_angle_share"], _BALANCE)
    return tolerance | {
        name: max(half, shipped.get(name, 0.0)) if name.startswith("suspension") and name not in stated.names else half
        for name, half in stated.tolerances.items()
    }


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


def _without_axle(name: str) -> str:
    """Name of a parameter without its axle."""
    return name.removesuffix("_front").removesuffix("_rear")


def _merge_axles(nuisances: tuple[Nuisance, ...], name: str) -> tuple[Nuisance, ...]:
    """Nuisances of both axles of a parameter as one: the set states one value for both."""
    of_axles = [one for one in nuisances if one.name.startswith(name)]
    if len(of_axles) < 2:  # known exactly: no nuisances
        return nuisances
    front, rear = of_axles
    both = replace(front, name=name, at=front.at + rear.at, step=front.step + rear.step)
    return tuple(both if one is front else one for one in nuisances if one is not rear)


def _derive(key: str, value: float, is_tolerance: bool, base: PlantParameters, stated: _Stated) -> None:
    """Add a key that is one member, or a multiple, of a parameter of the plant to ``stated``."""
    name, member, factor = DERIVED[key]
    if is_tolerance:
        stated.widen(name, value * factor)
    elif member is not None:
        now = stated.values.get(name, _value(base, name))
        changed = list(now) if isinstance(now, list | tuple) else [now]
        changed[member] = value * factor
        stated.values[name] = changed if isinstance(now, list | tuple) else changed[0]


def _by_axle(name: str, base: PlantParameters) -> bool:
    """Whether the plant has a value of the parameter per axle."""
    return name in PARAMETER.sizes and isinstance(_value(base, name), tuple)


def _number(value: Any, where: str) -> Any:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(map(is_number, numbers)):
        raise UnusableError(f"{where}: expected a number, got {value!r}")
    return value


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
    if not 0.0 < front < wheelbase:
        raise UnusableError(
            f"{where}: the centre of gravity is {front:g} m behind the front axle; expected 0 to {wheelbase:g}"
        )
    flat = {"vehicle_cog_to_axle_m": [float(front), wheelbase - float(front)]} | {
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
    stated: Collection[str],
) -> Vehicle:  # fmt: skip
    p = pack(parameters)
    return Vehicle(parameters, p, tuple(nuisance_parameters(p, tolerance, stated)), thermal, remarks)

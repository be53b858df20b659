"""The vehicle as handed in: a parameter vector and how far each number may be off."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hil.parameters import load_set, override
from hil.study.table import Floats, UnusableError
from hil.study.vehicle_keys import ALIASES, DERIVED, OF_SECTION, SPECIAL, UNLIMITED, WIDE
from plant.friction import mu_equilibrium
from plant.layout import Layout
from plant.model import pack
from plant.parameters.plant import PlantParameters
from plant.vectors import PARAMETER

HALF_WIDTH_TO_SIGMA = 0.5  # a tolerance is two standard deviations
_CONSTANT_EPSILON_W = 1e7
_CONSTANT_B_1_J = 2e-6
_BRAKE_K = 423.15
_STATED, _GUESSED = 0.01, 8.0
_WIDE, _MOST_FACTOR, _MOST_TIMES = 0.1, 1.7, 5.0
_FORM = {
    "motor_time_constant_s": 0.3, "ehb_dead_time_s": 0.3, "wheel_inertia_kg_m2": 0.1, "vehicle_cog_height_m": 0.15,
    "vehicle_yaw_inertia_kg_m2": 0.1, "vehicle_steering_ratio": 0.05,
}  # fmt: skip
_SUSPENSION = {
    "suspension_ride_rate_n_m": 0.3, "suspension_progression_n_m3": 1.0, "suspension_damping_ns_m": 0.3,
    "suspension_brake_support_tangent": 0.6, "suspension_anti_roll_nm_rad": 0.7, "suspension_roll_centre_height_m": 3.0,
    "vehicle_pitch_inertia_kg_m2": 0.6, "vehicle_roll_inertia_kg_m2": 0.2,
}  # fmt: skip
_LIFT = 0.1  # half-width of an axle's lift coefficient: twice the shipped tolerance, for sets seldom state it
_THERMAL = {"friction_brake_heat_capacity_j_k": 0.2, "friction_brake_cooling_w_k": 0.3}
"""Heat store of the discs; where the friction does not depend on temperature it does not matter."""
_SIGNED = ("suspension_progression_n_m3", "suspension_brake_support_tangent", "suspension_roll_centre_height_m")
"""Numbers that a car may have of either sign."""


@dataclass(frozen=True, eq=False)
class Nuisance:
    """A number of the vehicle that may be off: ``p[at] += z * step``, z normal with standard deviation 1.

    ``farthest`` is how many standard deviations it may be off at most; farther off it is a cause to be named.
    ``kind`` says of what: a number of the vehicle (``signed`` if it may be below zero), the discs' temperature at the
    start, the latency of a node, or of what holds a demand (never below zero).
    """

    name: str
    at: tuple[int, ...]
    step: tuple[float, ...]
    kind: str = "vehicle"
    farthest: float = 3.0


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A vehicle for the study.

    Attributes
    ----------
    parameters : as the plant wants them.  p : the same, flat.
    nuisances : what may be off, by tolerance.
    pad_temperature_matters : False where the brake has one gain and no friction model.
    remarks : unknown keys and defaults taken, for the report.
    unstated : sections that the set says nothing of (keys of `hil.study.vehicle_keys.OF_SECTION`).
    """

    parameters: PlantParameters
    p: Floats
    nuisances: tuple[Nuisance, ...]
    pad_temperature_matters: bool
    remarks: tuple[str, ...] = ()
    unstated: tuple[str, ...] = ()

    @property
    def untold(self) -> tuple[str, ...]:
        """Effects on sections that are not stated, so that no deviation can be told."""
        return tuple(effect for section in self.unstated for effect in OF_SECTION[section])


def paper_car() -> Vehicle:
    """The shipped set with its own tolerances."""
    source = resources.files("plant") / "parameters" / "paper_car.toml"
    parameters = load_set(source, PlantParameters)
    return _vehicle(parameters, _tolerances(tomllib.loads(source.read_text(encoding="utf-8"))), True, ())


def load_vehicle(source: Path | Mapping[str, Any] | None) -> Vehicle:
    """A flat TOML of SI numbers (or such a mapping); None is the shipped set. See `hil.study.vehicle_keys`.

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


def _tolerances(table: Mapping[str, Any]) -> dict[str, float]:
    return {
        f"{section}_{name}": float(entry["tolerance"])
        for section, entries in table.items()
        for name, entry in entries.items()
        if isinstance(entry, Mapping)
    }


def _from_flat(table: dict[str, Any], where: str) -> Vehicle:
    remarks: list[str] = []
    numbers: dict[str, Any] = {}
    tolerances: dict[str, float] = {}
    base = paper_car().parameters
    for key, value in table.items():
        stem = key.removesuffix("_tolerance")
        if stem in DERIVED and isinstance(value, int | float):
            _derive(stem, float(value), key != stem, base, numbers, tolerances)
            continue
        name = ALIASES.get(stem, stem)
        if name not in SPECIAL and name not in PARAMETER.sizes:
            if not isinstance(value, str):
                remarks.append(f"{where}: unknown key {key!r} is left out")
            continue
        if key != stem and isinstance(value, int | float):
            tolerances[name] = float(value)
        elif key == stem:
            numbers[name] = _number(value, f"{where}: {key}")
    source = resources.files("plant") / "parameters" / "paper_car.toml"
    shipped = _tolerances(tomllib.loads(source.read_text(encoding="utf-8")))
    changes, gains = _changes(numbers, base, where)
    unlimited = [section for section in UNLIMITED if section not in changes]
    for section in unlimited:
        if UNLIMITED[section]:
            changes[section] = dict(UNLIMITED[section])
        for name in UNLIMITED[section]:
            shipped.pop(f"{section}_{name}", None)
    if unlimited:
        remarks.append(
            f"{where}: nothing said of {', '.join(unlimited)}, so no limits of theirs are simulated "
            "and no demand is compared"
        )
    parameters = override(base, changes, where)
    friction = any(name.startswith("pad_") for name in numbers)
    if gains and not friction:
        parameters = replace(parameters, pad=_constant_pad(parameters))
    if gains:
        parameters = _with_gains(parameters, gains)
    tolerance = {name: shipped.get(name, 0.0) for name in PARAMETER.sizes}
    given = {name.removesuffix("_front").removesuffix("_rear") for name in numbers}
    for name in given & set(PARAMETER.sizes):  # stated, but not how well: to a hundredth
        if name not in tolerances:
            tolerance[name] = min(
                tolerance[name], _STATED * float(np.max(np.abs(np.asarray(_value(parameters, name)))))
            )
    missing = []
    for name, share in WIDE.items():
        if name not in given:
            missing.append(name)
            value = float(np.max(np.abs(np.asarray(_value(parameters, name)))))
            tolerance[name] = max(tolerance[name], share * value)
    if missing:
        remarks.append(f"{where}: not given, so a usual value with wide uncertainty: {', '.join(missing)}")
    tolerance |= {n: max(t, shipped.get(n, 0.0)) if n.startswith("suspension") else t for n, t in tolerances.items()}
    vehicle = _vehicle(parameters, tolerance, friction or not gains, tuple(remarks))
    nuisances = tuple(
        _guessed(one, vehicle.p) if one.name.removesuffix("_front").removesuffix("_rear") in missing else one
        for one in vehicle.nuisances
    )
    return replace(vehicle, nuisances=nuisances, unstated=tuple(unlimited))


def _guessed(nuisance: Nuisance, p: Floats) -> Nuisance:
    """A number that no set states may go far, but to no more than five times or a fifth."""
    factor = max(factor_of(p[at], step) for at, step in zip(nuisance.at, nuisance.step, strict=True))
    limit = np.log(_MOST_TIMES) / np.log(factor) if factor > 1.0 else _GUESSED
    return replace(nuisance, farthest=min(_GUESSED, float(limit)))


def factor_of(now: float, step: float) -> float:
    """By what one standard deviation multiplies a positive number known badly; 1 for one that it is added to."""
    wide = now > 0.0 and abs(step) >= _WIDE * now
    return min(1.0 + abs(step) / now, _MOST_FACTOR) if wide else 1.0


def _derive(
    key: str,
    value: float,
    is_tolerance: bool,
    base: PlantParameters,
    numbers: dict[str, Any],
    tolerances: dict[str, float],
) -> None:
    """A number that is one of a pair, or a multiple, of one of the plant's."""
    name, place, factor = DERIVED[key]
    if is_tolerance:
        tolerances[name] = max(tolerances.get(name, 0.0), value * factor)
    elif place is not None:
        now = numbers.get(name, _value(base, name))
        changed = list(now) if isinstance(now, list | tuple) else [now]
        changed[place] = value * factor
        numbers[name] = changed if isinstance(now, list | tuple) else changed[0]


def _number(value: Any, where: str) -> Any:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or any(isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v) for v in numbers):
        raise UnusableError(f"{where}: expected a number, got {value!r}")
    return value


def _value(parameters: PlantParameters, flat: str) -> Any:
    section = next(s for s in ("friction_brake", "vehicle", "suspension", "wheel", "tyre", "ehb", "pad", "motor",
                               "battery", "sensor") if flat.startswith(s + "_"))  # fmt: skip
    return getattr(getattr(parameters, section), flat.removeprefix(section + "_"))


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
        section = next(s for s in ("friction_brake", "vehicle", "suspension", "wheel", "tyre", "ehb", "pad", "motor",
                                   "battery", "sensor") if name.startswith(s + "_"))  # fmt: skip
        changes.setdefault(section, {})[name.removeprefix(section + "_")] = value
    return changes, gains


def _constant_pad(parameters: PlantParameters) -> Any:
    """Ostermeyer's equation with a rest value so stiff that the friction is one number."""
    mu, ambient = 0.38, parameters.friction_brake.ambient_k
    a = mu * _CONSTANT_B_1_J * _CONSTANT_EPSILON_W / ambient
    return replace(
        parameters.pad, a_1_ks=a, b_1_j=_CONSTANT_B_1_J, c_1_s=0.0, gamma_k_w=(0.0, 0.0),
        epsilon_w=_CONSTANT_EPSILON_W, heating_with_mu=0.0, temperature_of_disc=0.0,
    )  # fmt: skip


def rest_friction(parameters: PlantParameters, temperature_k: float) -> float:
    """Pad friction at rest."""
    pad = parameters.pad
    return mu_equilibrium(0.0, temperature_k, pad.a_1_ks, pad.b_1_j, pad.epsilon_w)


def _with_gains(parameters: PlantParameters, gains: Mapping[str, float]) -> PlantParameters:
    """Piston areas for torque per pressure and wheel: gain = 2 mu eta A r."""
    brake = parameters.friction_brake
    constant = parameters.pad.epsilon_w >= _CONSTANT_EPSILON_W
    mu = rest_friction(parameters, brake.ambient_k if constant else _BRAKE_K)
    areas = list(brake.piston_area_m2)
    for k, axle in enumerate(("front", "rear")):
        if axle in gains:
            areas[k] = gains[axle] / (2.0 * mu * brake.efficiency * brake.effective_radius_m[k])
    return replace(parameters, friction_brake=replace(brake, piston_area_m2=(areas[0], areas[1])))


def _vehicle(
    parameters: PlantParameters, tolerance: Mapping[str, float], thermal: bool, remarks: tuple[str, ...]
) -> Vehicle:
    p = pack(parameters)
    forms = _SUSPENSION | _THERMAL if thermal else _SUSPENSION
    return Vehicle(parameters, p, tuple(_nuisances(p, tolerance, forms, PARAMETER)), thermal, remarks)


def _nuisances(p: Floats, tolerance: Mapping[str, float], forms: Mapping[str, float], layout: Layout) -> list[Nuisance]:
    """One a parameter; what acts alike is one (radius and area, pad numbers), axles are moved together or apart."""
    found: list[Nuisance] = []

    def add(name: str, at: list[int], half: list[float]) -> None:
        if any(half):
            found.append(Nuisance(name, tuple(at), tuple(h * HALF_WIDTH_TO_SIGMA for h in half)))

    for name in (
        "vehicle_mass_kg", "vehicle_cog_height_m", "vehicle_drag_coefficient", "vehicle_rolling_resistance",
        "wheel_rolling_radius_m", "wheel_inertia_kg_m2", "tyre_lkx", "tyre_lsgkp", "ehb_natural_frequency_hz",
        "ehb_damping_ratio", "ehb_dead_time_s", "ehb_build_rate_pa_s", "ehb_release_rate_pa_s",
        "tyre_lmux", "friction_brake_threshold_pressure_pa", "motor_time_constant_s",
        "motor_rate_limit_nm_s", "motor_peak_torque_nm",
        "motor_fade_end_mps", "motor_fade_start_mps", "battery_charge_power_w", "sensor_imu_cutoff_hz",
        "tyre_lky", "vehicle_yaw_inertia_kg_m2", "vehicle_steering_ratio",
    ):  # fmt: skip
        at = layout.slice(name).start  # a model of the load transfer is no better than a few hundredths
        add(name, [at], [max(tolerance.get(name, 0.0), _FORM.get(name, 0.0) * float(p[at]))])
    cog = layout.slice("vehicle_cog_to_axle_m").start
    add(
        "vehicle_cog_to_axle_m",
        [cog, cog + 1],
        [tolerance.get("cog_to_front_axle_m", tolerance.get("vehicle_cog_to_axle_m", 0.0))] * 2,
    )
    found[-1] = replace(found[-1], step=(found[-1].step[0], -found[-1].step[1]))
    for k, axle in enumerate(("front", "rear")):
        area = layout.slice("friction_brake_piston_area_m2").start + k
        radius = layout.slice("friction_brake_effective_radius_m").start + k
        share = np.hypot(
            tolerance.get("friction_brake_piston_area_m2", 0.0) / p[area],
            tolerance.get("friction_brake_effective_radius_m", 0.0) / p[radius],
        )
        share = np.hypot(share, tolerance.get("friction_brake_efficiency", 0.0))
        gain = tolerance.get(f"brake_gain_{axle}")
        if gain is not None and np.isfinite(gain):
            brake_gain = 2.0 * p[layout.slice("pad_a_1_ks").start] / p[layout.slice("pad_b_1_j").start]
            brake_gain *= p[layout.slice("friction_brake_efficiency").start] * p[area] * p[radius]
            temperature = p[layout.slice("friction_brake_ambient_k").start]
            epsilon = p[layout.slice("pad_epsilon_w").start]
            reached = temperature if epsilon >= _CONSTANT_EPSILON_W else _BRAKE_K
            share = gain / (brake_gain * reached / epsilon)
        add(f"brake_gain_{axle}", [area], [float(share) * p[area]])
    for name in ("pad_a_1_ks", "pad_epsilon_w", "pad_c_1_s"):
        add(name, [layout.slice(name).start], [tolerance.get(name, 0.0)])
    # forms of curves that no vehicle set states: the tyre's near its peak and at the side, the roll of the body
    add("tyre_curve", [layout.slice("tyre_lex").start], [1.5])
    add("tyre_shape", [layout.slice("tyre_lcx").start], [0.1])
    add("tyre_stiffness_load", [layout.slice("tyre_pkx3").start], [0.3])
    add("tyre_friction_load", [layout.slice("tyre_pdx2").start], [0.04])
    add("tyre_relaxation_load", [layout.slice("tyre_ptx2").start], [3.0])
    add("wheel_brake_windup_time_s", [layout.slice("wheel_brake_windup_time_s").start], [0.006])
    add("tyre_lsgal", [layout.slice("tyre_lsgal").start], [0.5])
    add("tyre_lmuy", [layout.slice("tyre_lmuy").start], [0.15])
    lift = layout.slice("vehicle_lift_coefficient")
    for k, axle in enumerate(("front", "rear")):
        add(
            f"vehicle_lift_coefficient_{axle}",
            [lift.start + k],
            [max(tolerance.get("vehicle_lift_coefficient", 0.0), _LIFT)],
        )
        found[-1] = replace(found[-1], kind="signed")
    # the same for suspension and discs: a vehicle set states dive and roll at best, never the curves behind them
    for name, share in forms.items():
        at, size = layout.slice(name).start, layout.sizes[name]
        for k in range(size):
            half = max(tolerance.get(name, 0.0), share * float(p[at + k]))
            add(name if size == 1 else f"{name}_{('front', 'rear')[k]}", [at + k], [half])
            if name in _SIGNED:
                found[-1] = replace(found[-1], kind="signed")
    return found

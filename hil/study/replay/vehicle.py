"""The vehicle as handed in: files and mappings into a parameter vector and its tolerances."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from hil.parameters import ParameterError, is_number, load_set, override
from hil.study.logs.table import MOTOR_DEMAND, Floats, Log, UnusableError
from hil.study.replay.nuisances import BRAKE_K, CONSTANT_EPSILON_W, Nuisance, guessed, listed
from hil.study.replay.vehicle_keys import ALIASES, DERIVED, OF_SECTION, SPECIAL, UNLIMITED, WIDE
from plant.effects.effect import NODES
from plant.effects.theta import THETA
from plant.friction import mu_equilibrium
from plant.model import pack
from plant.parameters.plant import PlantParameters
from plant.vectors import PARAMETER, P

_CONSTANT_B_1_J = 2e-6
_STATED = 0.01
_LOOSE = (
    ("pressure_offset", "offset_pa", 7e3), ("pressure_gain", "gain", 0.005), ("iwm_gain", "gain", 0.005),
    ("iwm_gain", "unseen", 0.005), ("pad_mu_gain", "gain", 0.01), ("tyre_radius", "gain", 0.0012),
)  # fmt: skip
"""Standard deviations of a pressure sensor's zero and gain, of the torque a motor gives of what is asked and of what it
tells, of the pads' friction, and of a wheel's radius beside the others' (docs/decisions/0093 and 0094)."""
_CLOCK_SHARE = 5e-5
"""Standard deviation of the rate of one node's clock: quartz is good to 20 to 100 ppm (plant/effects/sensing)."""
_STRAIGHT_AHEAD_RAD = 0.01
"""Standard deviation of the steering wheel's angle at which a car goes straight. Workshop manuals let the sensor's zero
be set within 3 to 5 degrees of that (Hyundai Motor, Grandeur 2006: within 5, nonlinear by 2.5); here half a degree."""
_THRESHOLD = "friction_brake_threshold_pressure_pa"
_BALANCE = 0.3
"""Half width of what an axle's cornering stiffness may be off beside the other's, where nobody states the tyres'."""
_HELD_KG_M2 = 1e12
"""Yaw inertia of a car that cannot turn."""
_TURNING = (
    "vehicle_yaw_inertia_kg_m2", "vehicle_steering_ratio", "tyre_lky", "vehicle_slip_angle_share_front",
    "vehicle_slip_angle_share_rear", "tyre_side_stiffness_load", "zero_steering",
)  # fmt: skip
_OF_STEERING = ("steer_lateral",)
_KNOWN = sorted({*ALIASES, *DERIVED, *SPECIAL, *PARAMETER.sizes})
_FORMS = ("tyre_", "suspension_")
"""Sections whose curves no set states: where it says nothing else of them either, they may go as far as any guess."""
_THEN = {
    "ehb": "pressures are compared only where none has been asked for a while, and left and right where the same is",
    "motor": "torques of the motors are not compared with what is asked of them",
}
"""What follows where a set says nothing of a section."""


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A vehicle for the study.

    Attributes
    ----------
    parameters : as the plant wants them.  p : the same, flat.
    nuisances : what may be off, by tolerance.
    pad_temperature_matters : False where the brake has one gain and no friction model.
    remarks : unknown keys and defaults taken, for the report.
    unstated : sections that the set says nothing of (keys of `hil.study.replay.vehicle_keys.OF_SECTION`).
    unlimited : limits that it does not state, which do not act.
    straight : whether it is held on its line.
    """

    parameters: PlantParameters
    p: Floats
    nuisances: tuple[Nuisance, ...]
    pad_temperature_matters: bool
    remarks: tuple[str, ...] = ()
    unstated: tuple[str, ...] = ()
    unlimited: tuple[str, ...] = ()
    straight: bool = False

    @property
    def untold(self) -> tuple[str, ...]:
        """Effects on sections that are not stated, or on a steering that holds against them: none can be told."""
        unstated = tuple(effect for section in self.unstated for effect in OF_SECTION[section])
        return (*unstated, *_OF_STEERING) if self.straight else unstated

    def asked(self, logs: Sequence[Log]) -> "Vehicle":
        """The same car, its motors no stronger than what is asked of them in the logs, if the set does not say.

        Fading takes a share of what a motor can, which is of nothing known where that is not.
        """
        demands = [log.channels[name] for log in logs for name in MOTOR_DEMAND if name in log.channels]
        most = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in demands), default=0.0)
        if "motor_peak_torque_nm" not in self.unlimited or most == 0.0:
            return self
        motor = replace(self.parameters.motor, peak_torque_nm=most)
        parameters = replace(self.parameters, motor=motor)
        p = self.p.copy()
        p[P.motor_peak_torque_nm] = most
        return replace(self, parameters=parameters, p=p)

    def held_straight(self) -> "Vehicle":
        """The same car kept on its line by a driver who is not seen: without lateral motion, whatever pulls."""
        p = self.p.copy()
        p[P.vehicle_yaw_inertia_kg_m2] = _HELD_KG_M2
        nuisances = tuple(one for one in self.nuisances if one.name not in _TURNING)
        said = "no log tells how it was steered, nor that it turned: the car is held straight against whatever pulls"
        return replace(self, p=p, nuisances=nuisances, straight=True, remarks=(*self.remarks, said))


def paper_car() -> Vehicle:
    """The shipped set with its own tolerances."""
    source = resources.files("plant") / "parameters" / "paper_car.toml"
    parameters = load_set(source, PlantParameters)
    return _vehicle(parameters, _tolerances(tomllib.loads(source.read_text(encoding="utf-8"))), True, ())


def load_vehicle(source: Path | Mapping[str, Any] | None) -> Vehicle:
    """A flat TOML of SI numbers (or such a mapping); None is the shipped set. See `hil.study.replay.vehicle_keys`.

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
                near = get_close_matches(stem, _KNOWN, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                remarks.append(f"{where}: unknown key {key!r} is left out{hint}")
            continue
        given = _number(value, f"{where}: {key}")
        if key != stem:
            tolerances[name] = max(tolerances.get(name, 0.0), *(given if isinstance(given, list) else [given]))
        elif isinstance(given, list) and not _by_axle(name, base):
            numbers[name], apart = float(np.mean(given)), 0.5 * float(np.ptp(given))
            tolerances[name] = max(tolerances.get(name, 0.0), apart)
            remarks.append(
                f"{where}: {key} is one number of the car: {numbers[name]:g} is taken, {apart:g} more or less"
            )
        else:
            numbers[name] = given
    source = resources.files("plant") / "parameters" / "paper_car.toml"
    shipped = _tolerances(tomllib.loads(source.read_text(encoding="utf-8")))
    changes, gains = _changes(numbers, base, where)
    unstated = [section for section in UNLIMITED if section not in changes]
    unlimited = []
    for section, limits in UNLIMITED.items():
        for together in limits:
            stated = changes.setdefault(section, {})
            if not together.keys() & stated.keys():
                stated.update(together)
                unlimited += [f"{section}_{name}" for name in together]
    for name in unlimited:
        shipped.pop(name, None)
    if unlimited:
        remarks.append(f"{where}: not given, so no such limit is simulated: {', '.join(unlimited)}")
    if unstated:
        remarks.append(
            f"{where}: nothing said of {', '.join(unstated)}"
            + "".join(f"; {_THEN[section]}" for section in unstated if section in _THEN)
        )
    try:
        parameters = override(base, changes, where)
    except ParameterError as error:
        raise UnusableError(str(error)) from error
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
    tolerance |= {f"brake_gain_{axle}": _STATED * gain for axle, gain in gains.items()}
    missing = []
    for name, share in WIDE.items():
        if name not in given:
            missing.append(name)
            value = float(np.max(np.abs(np.asarray(_value(parameters, name)))))
            tolerance[name] = max(tolerance[name], share * value)
    if "tyre_lky" in missing:
        tolerance["vehicle_slip_angle_share"] = max(tolerance["vehicle_slip_angle_share"], _BALANCE)
    if missing:
        remarks.append(f"{where}: not given, so a usual value with wide uncertainty: {', '.join(missing)}")
    tolerance |= {n: max(t, shipped.get(n, 0.0)) if n.startswith("suspension") else t for n, t in tolerances.items()}
    vehicle = _vehicle(parameters, tolerance, friction or not gains, tuple(remarks))
    silent = tuple(s for s in _FORMS if not any(name.startswith(s) for name in (*given, *tolerances)))
    nuisances = tuple(
        guessed(one, vehicle.p)
        if one.name.startswith(silent) or one.name.removesuffix("_front").removesuffix("_rear") in missing
        else one
        for one in vehicle.nuisances
    )
    if is_number(numbers.get(_THRESHOLD)):
        nuisances = _as_one(nuisances, _THRESHOLD)
    if unlimited:  # who states every limit has measured the rest as well
        followed = [one for one in _LOOSE if one[:2] != ("iwm_gain", "gain") or "motor" not in unstated]
        nuisances = (*nuisances, *_by_wheel(followed), *_clocks(), _straight_ahead(vehicle.p))
    return replace(vehicle, nuisances=nuisances, unstated=tuple(unstated), unlimited=tuple(unlimited))


def _as_one(nuisances: tuple[Nuisance, ...], name: str) -> tuple[Nuisance, ...]:
    """A number of each axle that is stated once is one number."""
    front, rear = (one for one in nuisances if one.name.startswith(name))
    both = replace(front, name=name, at=front.at + rear.at, step=front.step + rear.step)
    return tuple(both if one is front else one for one in nuisances if one is not rear)


def _by_wheel(loose: Sequence[tuple[str, str, float]]) -> list[Nuisance]:
    """What each brake, motor and tyre may be off by itself: effect, number and standard deviation."""
    return [
        Nuisance(f"{effect}.{number}_{wheel}", (THETA.slice(effect, number).start + k,), (step,), "scatter")
        for effect, number, step in loose
        for k, wheel in enumerate(("fl", "fr", "rl", "rr"))
    ]


def _clocks() -> list[Nuisance]:
    """By how much the clock of each node that measures may run fast."""
    first = THETA.slice("clock_drift", "share").start
    measure = [node for node in NODES if node != "driver"]
    return [
        Nuisance(f"clock_drift.share_{node}", (first + NODES.index(node),), (_CLOCK_SHARE,), "scatter")
        for node in measure
    ]


def _straight_ahead(p: Floats) -> Nuisance:
    """At which angle of the steering wheel it goes straight, as one of its front wheels."""
    at = THETA.slice("steer_lateral", "offset_rad").start
    return Nuisance("zero_steering", (at,), (_STRAIGHT_AHEAD_RAD / float(p[P.vehicle_steering_ratio]),), "sensor")


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


def _by_axle(name: str, base: PlantParameters) -> bool:
    """Whether a number of the plant stands once for each axle."""
    return name in PARAMETER.sizes and isinstance(_value(base, name), tuple)


def _number(value: Any, where: str) -> Any:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(map(is_number, numbers)):
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
    a = mu * _CONSTANT_B_1_J * CONSTANT_EPSILON_W / ambient
    return replace(
        parameters.pad, a_1_ks=a, b_1_j=_CONSTANT_B_1_J, c_1_s=0.0, gamma_k_w=(0.0, 0.0),
        epsilon_w=CONSTANT_EPSILON_W, heating_with_mu=0.0, temperature_of_disc=0.0,
    )  # fmt: skip


def rest_friction(parameters: PlantParameters, temperature_k: float) -> float:
    """Pad friction at rest."""
    pad = parameters.pad
    return mu_equilibrium(0.0, temperature_k, pad.a_1_ks, pad.b_1_j, pad.epsilon_w)


def _with_gains(parameters: PlantParameters, gains: Mapping[str, float]) -> PlantParameters:
    """Piston areas for torque per pressure and wheel: gain = 2 mu eta A r."""
    brake = parameters.friction_brake
    constant = parameters.pad.epsilon_w >= CONSTANT_EPSILON_W
    mu = rest_friction(parameters, brake.ambient_k if constant else BRAKE_K)
    areas = list(brake.piston_area_m2)
    for k, axle in enumerate(("front", "rear")):
        if axle in gains:
            areas[k] = gains[axle] / (2.0 * mu * brake.efficiency * brake.effective_radius_m[k])
    return replace(parameters, friction_brake=replace(brake, piston_area_m2=(areas[0], areas[1])))


def _vehicle(
    parameters: PlantParameters, tolerance: Mapping[str, float], thermal: bool, remarks: tuple[str, ...]
) -> Vehicle:
    p = pack(parameters)
    return Vehicle(parameters, p, tuple(listed(p, tolerance, thermal, PARAMETER)), thermal, remarks)

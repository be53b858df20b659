"""Nonparametric terms: unknown functions of one variable at an injection point, rivals of the listed effects.

A term is ``c_1 f_1(v) + ... + c_5 f_5(v)`` with hat functions over the range of ``v`` that the logs cover, multiplied
or added at an injection point of the plant (`plant.injection.bank`). With listed effects alone, an unlisted cause would
get a wrong name. Takes a simulator and a parameter set, gives the basis expansions and, of fitted ones, the curves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.estimation.model_discrepancy import UNLISTED
from hil.diagnosis.estimation.terms import LOCATIONS, Candidate
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator
from plant.effects.effect import Effect, Parameter, Scope
from plant.injection.bank import Shape, Variable, term
from plant.injection_points import INJECTION_POINTS

BASIS_SIZE = 5
_WHEELS = Scope.WHEEL.members
_VARIABLE_NAMES = {
    Variable.SPEED: "speed", Variable.WHEEL_SPEED: "wheel_speed", Variable.PRESSURE: "pressure",
    Variable.DISC_TEMPERATURE: "disc_temperature", Variable.APPLIED_TIME: "time_since_on", Variable.TIME: "time",
    Variable.MOTOR_TORQUE: "motor_torque", Variable.ACCELERATION: "acceleration", Variable.YAW_RATE: "yaw_rate",
    Variable.DISTANCE: "distance",
}  # fmt: skip
_COLUMNS = {
    Variable.SPEED: ["state.speed_mps"], Variable.WHEEL_SPEED: [f"state.wheel_speed_rad_s_{w}" for w in _WHEELS],
    Variable.PRESSURE: [f"pressure_pa_{w}" for w in _WHEELS],
    Variable.DISC_TEMPERATURE: [f"state.disc_temperature_k_{w}" for w in _WHEELS], Variable.TIME: ["state.time_s"],
    Variable.MOTOR_TORQUE: [f"motor_torque_nm_{w}" for w in _WHEELS],
    Variable.ACCELERATION: ["state.imu_longitudinal_mps2"], Variable.YAW_RATE: ["state.yaw_rate_rad_s"],
    Variable.DISTANCE: ["state.distance_m"],
}  # fmt: skip
_APPLIED_S = (0.0, 4.0)
"""Range of the time since a brake was applied, s."""
_EDGE, _LEAST_RANGE = 0.01, 1e-6
"""Quantile at either end that a range leaves out; smallest range, in the variable's unit."""


@dataclass(frozen=True)
class NonparametricTerm:
    """An unknown function: where it enters, the variable it depends on, whether it is added or a factor, and its
    typical size (unit of the injection point, or a share)."""

    injection_point: str
    variable: Variable
    adds: bool
    typical: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{self.injection_point}({_VARIABLE_NAMES[self.variable]})"

    @property
    def scope(self) -> Scope:
        """Wheel where the injection point has four members, else car."""
        return Scope.WHEEL if INJECTION_POINTS[self.injection_point][0] == 4 else Scope.CAR


NONPARAMETRIC_TERMS = (
    *(NonparametricTerm("friction.mu", v, False, 0.2) for v in (
        Variable.SPEED, Variable.PRESSURE, Variable.DISC_TEMPERATURE, Variable.APPLIED_TIME, Variable.TIME,
    )),
    *(NonparametricTerm("motor.torque", v, False, 0.06) for v in (
        Variable.WHEEL_SPEED, Variable.MOTOR_TORQUE, Variable.TIME,
    )),
    *(NonparametricTerm("body.force", v, True, 200.0) for v in (
        Variable.SPEED, Variable.TIME, Variable.DISTANCE, Variable.YAW_RATE,
    )),
    NonparametricTerm("wheel.rolling_torque", Variable.SPEED, False, 0.4),
    NonparametricTerm("tyre.stiffness", Variable.SPEED, False, 0.2),
    NonparametricTerm("wheel.radius", Variable.SPEED, False, 0.005),
    NonparametricTerm("imu.ax", Variable.SPEED, True, 0.05),
    NonparametricTerm("imu.ax", Variable.ACCELERATION, True, 0.05),
)  # fmt: skip
"""All nonparametric terms; what few data show depends on speed alone. A force by acceleration is mass, and no term."""


@dataclass(frozen=True, eq=False)
class BasisFunction(Candidate):
    """One hat function of a nonparametric term at a location; its coefficient is the parameter."""

    term: NonparametricTerm
    centre: float
    width: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{UNLISTED}.{self.term.name}.{self.parameter.name}@{self.location}"

    @property
    def variable(self) -> str:
        """Name of the variable."""
        return _VARIABLE_NAMES[self.term.variable]

    def members(self) -> tuple[int, ...]:
        """Members of the injection point it acts on."""
        return LOCATIONS[self.term.scope][self.location]

    def row(self, value: float) -> Floats:
        """Its row of the bank (`plant.injection.bank`) at this coefficient."""
        coefficients = [value if k in self.members() else 0.0 for k in range(self.term.scope.size)]
        shaped = (self.term.variable, Shape.HAT, self.centre, self.width)
        return term(self.term.injection_point, coefficients, shaped, add=self.term.adds)

    def applied(self, base: ParameterSet, value: float) -> ParameterSet:
        """The parameter set with this coefficient added."""
        return base.with_rows(self.row(value))


@dataclass(frozen=True, eq=False)
class BasisExpansion:
    """A nonparametric term at a location with its basis functions."""

    term: NonparametricTerm
    location: str
    functions: tuple[BasisFunction, ...]

    @property
    def name(self) -> str:
        """For people: term and location."""
        return f"{self.term.name}@{self.location}"

    @property
    def variable(self) -> str:
        """Name of the variable."""
        return _VARIABLE_NAMES[self.term.variable]

    def at(self, location: str) -> "BasisExpansion":
        """The same term elsewhere."""
        moved = tuple(replace(function, location=location) for function in self.functions)
        return replace(self, location=location, functions=moved)


def basis_expansions(simulator: Simulator, base: ParameterSet) -> list[BasisExpansion]:
    """Every term whose variable covers a range in the logs, expanded over it, at all wheels."""
    ranges = _ranges(simulator, base)
    expansions = []
    for one in NONPARAMETRIC_TERMS:
        low, high = ranges[_excitation(one), one.variable]
        if high - low > _LEAST_RANGE:
            expansions.append(basis_expansion(one, low, high))
    return expansions


def at_each_location(expansion: BasisExpansion) -> Iterator[BasisExpansion]:
    """The term at every location."""
    return (expansion.at(location) for location in LOCATIONS[expansion.term.scope])


def basis_expansion(unknown: NonparametricTerm, low: float, high: float) -> BasisExpansion:
    """A term at all members, its hat functions evenly over a range of its variable."""
    centres = np.linspace(low, high, BASIS_SIZE)
    point, variable = unknown.injection_point, _VARIABLE_NAMES[unknown.variable]
    unit = INJECTION_POINTS[point][1] if unknown.adds else ""
    bound = 20.0 * unknown.typical if unknown.adds else 0.9
    coefficients = tuple(Parameter(f"c{k + 1}", unit, -bound, bound, unknown.typical) for k in range(BASIS_SIZE))
    effect = Effect(
        name=UNLISTED, row=0, title=f"{point} depends on {variable} in a way that no list has",
        equation="sum c_k hat((v - v_k) / w)", injection_points=(point,), scope=unknown.scope, parameters=coefficients,
        source="measured data", signature="", manoeuvre="",
    )  # fmt: skip
    width = float(centres[1] - centres[0])
    functions = [
        BasisFunction(effect, one, "car", (), 1, unknown, float(c), width)
        for one, c in zip(coefficients, centres, strict=True)
    ]
    return BasisExpansion(unknown, "car", tuple(functions))


def _excitation(unknown: NonparametricTerm) -> str:
    """Samples over which the range counts."""
    return {"friction.mu": "brake", "motor.torque": "motor"}.get(unknown.injection_point, "moving")


def _ranges(simulator: Simulator, base: ParameterSet) -> dict[tuple[str, Variable], tuple[float, float]]:
    """Range of each variable by samples in which the car moves, brakes, drives by its motors; few outliers left out."""
    names = [name for columns in _COLUMNS.values() for name in columns]
    table = simulator.states(base, names)
    values, at = {}, 0
    for variable, columns in _COLUMNS.items():
        values[variable] = table[:, at : at + len(columns)] + np.zeros((len(table), 4))
        at += len(columns)
    whole = np.isfinite(table).all(axis=1, keepdims=True)
    moving = np.logical_and(values[Variable.SPEED] > 2.0, whole)
    masks = {
        "moving": moving, "brake": np.logical_and(moving, values[Variable.PRESSURE] > 2e5),
        "motor": np.logical_and(moving, np.abs(values[Variable.MOTOR_TORQUE]) > 20.0),
    }  # fmt: skip
    ranges = {}
    for excitation, mask in masks.items():
        for variable, of in values.items():
            some = of[mask]
            low, high = np.quantile(some, (_EDGE, 1.0 - _EDGE)) if some.size else (0.0, 0.0)
            ranges[excitation, variable] = float(low), float(high)
        ranges[excitation, Variable.APPLIED_TIME] = _APPLIED_S if mask.any() else (0.0, 0.0)
    return ranges


def estimate_curve(
    functions: Sequence[BasisFunction], values: Sequence[float], covariance: Floats, points: int = 21
) -> list[dict[str, float]]:
    """The curve with its 95 % band: factor less one, or addend in the injection point's unit."""
    centres = np.array([function.centre for function in functions])
    x = np.linspace(centres[0], centres[-1], points)
    hats = np.maximum(1.0 - np.abs(x[:, None] - centres) / functions[0].width, 0.0)
    y = hats @ np.asarray(values)
    half = 1.96 * np.sqrt(np.maximum(np.einsum("xi,ij,xj->x", hats, covariance, hats), 0.0))
    return [
        {"x": float(a), "y": float(b), "low": float(b - h), "high": float(b + h)}
        for a, b, h in zip(x, y, half, strict=True)
    ]

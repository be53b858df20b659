"""Causes nobody listed: curves of one variable at a joint, in the same race as the listed effects.

A law is ``c_1 f_1(v) + ... + c_5 f_5(v)`` with hats over the range that the logs cover, multiplied or added at a joint
of the plant (`plant.injection.bank`). Listed effects alone would take a wrong name for what is in no list.
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
_CALLED = {
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
_EDGE, _LEAST_RANGE = 0.01, 1e-6


@dataclass(frozen=True)
class NonparametricTerm:
    """Where and on what an unlisted cause may depend: joint, variable, whether it is added, usual size (of the joint's
    unit, or a share), and whether single wheels are told apart in the race."""

    injection_point: str
    variable: Variable
    adds: bool
    typical: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{self.injection_point}({_CALLED[self.variable]})"

    @property
    def scope(self) -> Scope:
        """Whether each wheel has its own."""
        return Scope.WHEEL if INJECTION_POINTS[self.injection_point][0] == 4 else Scope.CAR


NONPARAMETRIC_TERMS = (
    *(NonparametricTerm("friction.mu", v, False, 0.2) for v in (
        Variable.SPEED, Variable.PRESSURE, Variable.DISC_TEMPERATURE, Variable.APPLIED_TIME, Variable.TIME,
    )),
    *(NonparametricTerm("motor.torque", v, False, 0.06) for v in (Variable.WHEEL_SPEED, Variable.MOTOR_TORQUE, Variable.TIME)),
    *(NonparametricTerm("body.force", v, True, 200.0) for v in (
        Variable.SPEED, Variable.TIME, Variable.DISTANCE, Variable.YAW_RATE,
    )),
    NonparametricTerm("wheel.rolling_torque", Variable.SPEED, False, 0.4),
    NonparametricTerm("tyre.stiffness", Variable.SPEED, False, 0.2),
    NonparametricTerm("wheel.radius", Variable.SPEED, False, 0.005),
    NonparametricTerm("imu.ax", Variable.SPEED, True, 0.05),
    NonparametricTerm("imu.ax", Variable.ACCELERATION, True, 0.05),
)  # fmt: skip
"""The laws in the race; speed is the only variable of what is weakly seen. A force by acceleration is mass."""


@dataclass(frozen=True, eq=False)
class BasisFunction(Candidate):
    """One hat of a law at a place."""

    term: NonparametricTerm
    centre: float
    width: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{UNLISTED}.{self.term.name}.{self.parameter.name}@{self.location}"

    @property
    def variable(self) -> str:
        """What it depends on."""
        return _CALLED[self.term.variable]

    def members(self) -> tuple[int, ...]:
        """Members of the joint it acts on."""
        return LOCATIONS[self.term.scope][self.location]

    def row(self, value: float) -> Floats:
        """Its row of the bank."""
        coefficients = [value if k in self.members() else 0.0 for k in range(self.term.scope.size)]
        shaped = (self.term.variable, Shape.HAT, self.centre, self.width)
        return term(self.term.injection_point, coefficients, shaped, add=self.term.adds)

    def applied(self, world: ParameterSet, value: float) -> ParameterSet:
        """The world with this number added."""
        return replace(world, nonparametric_rows=np.vstack([world.nonparametric_rows, self.row(value)]))


@dataclass(frozen=True, eq=False)
class BasisExpansion:
    """A law at a place with its hats."""

    term: NonparametricTerm
    location: str
    functions: tuple[BasisFunction, ...]

    @property
    def variable(self) -> str:
        """Name of what it depends on."""
        return _CALLED[self.term.variable]

    def at(self, place: str) -> "BasisExpansion":
        """The same law elsewhere."""
        return replace(
            self, location=place, functions=tuple(replace(piece, location=place) for piece in self.functions)
        )


def basis_expansions(rig: Simulator, world: ParameterSet) -> list[BasisExpansion]:
    """Every law over the range its variable covers in the logs, at all wheels; those with a range."""
    seen = _ranges(rig, world)
    found = []
    for law in NONPARAMETRIC_TERMS:
        low, high = seen[_acting(law), law.variable]
        if high - low > _LEAST_RANGE:
            found.append(basis_expansion(law, low, high))
    return found


def at_each_location(curve: BasisExpansion) -> Iterator[BasisExpansion]:
    """The law at every place."""
    return (curve.at(place) for place in LOCATIONS[curve.term.scope])


def basis_expansion(law: NonparametricTerm, low: float, high: float) -> BasisExpansion:
    """A law at all members, its hats evenly over a range of its variable."""
    centres = np.linspace(low, high, BASIS_SIZE)
    unit = INJECTION_POINTS[law.injection_point][1] if law.adds else ""
    bound = 20.0 * law.typical if law.adds else 0.9
    numbers = tuple(Parameter(f"c{k + 1}", unit, -bound, bound, law.typical) for k in range(BASIS_SIZE))
    effect = Effect(
        name=UNLISTED, row=0, title=f"{law.injection_point} depends on {_CALLED[law.variable]} in a way that no list has",
        equation="sum c_k hat((v - v_k) / w)", injection_points=(law.injection_point,), scope=law.scope,
        parameters=numbers,
        source="measured data", signature="", manoeuvre="",
    )  # fmt: skip
    width = float(centres[1] - centres[0])
    pieces = [
        BasisFunction(effect, one, "car", (), 1, law, float(c), width) for one, c in zip(numbers, centres, strict=True)
    ]
    return BasisExpansion(law, "car", tuple(pieces))


def _acting(law: NonparametricTerm) -> str:
    """Over which samples the range counts."""
    return {"friction.mu": "brake", "motor.torque": "motor"}.get(law.injection_point, "moving")


def _ranges(rig: Simulator, world: ParameterSet) -> dict[tuple[str, Variable], tuple[float, float]]:
    names = [name for columns in _COLUMNS.values() for name in columns]
    table = rig.states(world, names)
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
    found = {}
    for acting, mask in masks.items():
        for variable, of in values.items():
            some = of[mask]
            low, high = np.quantile(some, (_EDGE, 1.0 - _EDGE)) if some.size else (0.0, 0.0)
            found[acting, variable] = float(low), float(high)
        found[acting, Variable.APPLIED_TIME] = _APPLIED_S if mask.any() else (0.0, 0.0)
    return found


def estimate_curve(
    pieces: Sequence[BasisFunction], values: Sequence[float], covariance: Floats, points: int = 21
) -> list[dict[str, float]]:
    """The curve with its 95 % band: factor less one, or addend in the joint's unit."""
    centres = np.array([piece.centre for piece in pieces])
    x = np.linspace(centres[0], centres[-1], points)
    hats = np.maximum(1.0 - np.abs(x[:, None] - centres) / pieces[0].width, 0.0)
    y = hats @ np.asarray(values)
    half = 1.96 * np.sqrt(np.maximum(np.einsum("xi,ij,xj->x", hats, covariance, hats), 0.0))
    return [
        {"x": float(a), "y": float(b), "low": float(b - h), "high": float(b + h)}
        for a, b, h in zip(x, y, half, strict=True)
    ]

"""Causes nobody listed: curves of one variable at a joint, in the same race as the listed effects.

A law is ``c_1 f_1(v) + ... + c_5 f_5(v)`` with hats over the range that the logs cover, multiplied or added at a joint
of the plant (`plant.injection.bank`). Listed effects alone would take a wrong name for what is in no list.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.study.fitting.candidates import PLACES, Candidate
from hil.study.fitting.own_error import UNLISTED
from hil.study.logs.table import Floats
from hil.study.replay.rig import Rig
from hil.study.replay.world import World
from plant.effects.effect import Effect, Parameter, Scope
from plant.injection.bank import Shape, Variable, term
from plant.injection_points import INJECTION_POINTS

PIECES = 5
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
class Law:
    """Where and on what an unlisted cause may depend: joint, variable, whether it is added, usual size (of the joint's
    unit, or a share), and whether single wheels are told apart in the race."""

    joint: str
    variable: Variable
    adds: bool
    usual: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{self.joint}({_CALLED[self.variable]})"

    @property
    def scope(self) -> Scope:
        """Whether each wheel has its own."""
        return Scope.WHEEL if INJECTION_POINTS[self.joint][0] == 4 else Scope.CAR


LAWS = (
    *(Law("friction.mu", v, False, 0.2) for v in (
        Variable.SPEED, Variable.PRESSURE, Variable.DISC_TEMPERATURE, Variable.APPLIED_TIME, Variable.TIME,
    )),
    *(Law("motor.torque", v, False, 0.06) for v in (Variable.WHEEL_SPEED, Variable.MOTOR_TORQUE, Variable.TIME)),
    *(Law("body.force", v, True, 200.0) for v in (
        Variable.SPEED, Variable.TIME, Variable.DISTANCE, Variable.YAW_RATE,
    )),
    Law("wheel.rolling_torque", Variable.SPEED, False, 0.4),
    Law("tyre.stiffness", Variable.SPEED, False, 0.2),
    Law("wheel.radius", Variable.SPEED, False, 0.005),
    Law("imu.ax", Variable.SPEED, True, 0.05),
    Law("imu.ax", Variable.ACCELERATION, True, 0.05),
)  # fmt: skip
"""The laws in the race; speed is the only variable of what is weakly seen. A force by acceleration is mass."""


@dataclass(frozen=True, eq=False)
class Piece(Candidate):
    """One hat of a law at a place."""

    law: Law
    centre: float
    width: float

    @property
    def name(self) -> str:
        """For people and keys."""
        return f"{UNLISTED}.{self.law.name}.{self.parameter.name}@{self.place}"

    @property
    def variable(self) -> str:
        """What it depends on."""
        return _CALLED[self.law.variable]

    def members(self) -> tuple[int, ...]:
        """Members of the joint it acts on."""
        return PLACES[self.law.scope][self.place]

    def row(self, value: float) -> Floats:
        """Its row of the bank."""
        coefficients = [value if k in self.members() else 0.0 for k in range(self.law.scope.size)]
        shaped = (self.law.variable, Shape.HAT, self.centre, self.width)
        return term(self.law.joint, coefficients, shaped, add=self.law.adds)

    def applied(self, world: World, value: float) -> World:
        """The world with this number added."""
        return replace(world, terms=np.vstack([world.terms, self.row(value)]))


@dataclass(frozen=True, eq=False)
class Curve:
    """A law at a place with its hats."""

    law: Law
    place: str
    pieces: tuple[Piece, ...]

    @property
    def variable(self) -> str:
        """Name of what it depends on."""
        return _CALLED[self.law.variable]

    def at(self, place: str) -> "Curve":
        """The same law elsewhere."""
        return replace(self, place=place, pieces=tuple(replace(piece, place=place) for piece in self.pieces))


def curves(rig: Rig, world: World) -> list[Curve]:
    """Every law over the range its variable covers in the logs, at all wheels; those with a range."""
    seen = _ranges(rig, world)
    found = []
    for law in LAWS:
        low, high = seen[_acting(law), law.variable]
        if high - low > _LEAST_RANGE:
            found.append(curve_of(law, low, high))
    return found


def places(curve: Curve) -> Iterator[Curve]:
    """The law at every place."""
    return (curve.at(place) for place in PLACES[curve.law.scope])


def curve_of(law: Law, low: float, high: float) -> Curve:
    """A law at all members, its hats evenly over a range of its variable."""
    centres = np.linspace(low, high, PIECES)
    unit = INJECTION_POINTS[law.joint][1] if law.adds else ""
    bound = 20.0 * law.usual if law.adds else 0.9
    numbers = tuple(Parameter(f"c{k + 1}", unit, -bound, bound, law.usual) for k in range(PIECES))
    effect = Effect(
        name=UNLISTED, row=0, title=f"{law.joint} depends on {_CALLED[law.variable]} in a way that no list has",
        equation="sum c_k hat((v - v_k) / w)", injection_points=(law.joint,), scope=law.scope, parameters=numbers,
        source="measured data", signature="", manoeuvre="",
    )  # fmt: skip
    width = float(centres[1] - centres[0])
    pieces = [Piece(effect, one, "car", (), 1, law, float(c), width) for one, c in zip(numbers, centres, strict=True)]
    return Curve(law, "car", tuple(pieces))


def _acting(law: Law) -> str:
    """Over which samples the range counts."""
    return {"friction.mu": "brake", "motor.torque": "motor"}.get(law.joint, "moving")


def _ranges(rig: Rig, world: World) -> dict[tuple[str, Variable], tuple[float, float]]:
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


def shown(
    pieces: Sequence[Piece], values: Sequence[float], covariance: Floats, points: int = 21
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

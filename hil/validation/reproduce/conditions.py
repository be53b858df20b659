"""The worlds that the claims are tried in: the nominal one, each thing the controller does not know, all at once."""

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from hil.diagnosis.result.extended_scenario import extended_scenario
from hil.scenario.effects import NONE, Effects
from hil.scenario.parameters import override
from hil.scenario.scenario import load_scenario
from plant.parameters.plant import PlantParameters
from plant.road import RoadSegment

MOTOR_GAIN = 0.02
ACCELERATION_OFFSET_MPS2 = 0.02
BRAKE = ("friction.mu", "brake.torque")
"""Joints of the friction brake: what acts there is what compensation is to make up for."""


@dataclass(frozen=True)
class Condition:
    """How the plant differs from what the controller believes.

    Attributes
    ----------
    name : as printed.  factors : parameter table and name -> factor.  values : ... -> value.
    grade : of the road, rise over run.
    friction : true friction of the pads on each axle over what the pads alone have, as seen through the controller's
        nominal brake geometry.
    car : the set that ``factors`` and ``values`` change, None for the paper's.  effects : what it has besides.
    """

    name: str
    factors: dict[str, dict[str, tuple[float, ...]]] = field(default_factory=dict)
    values: dict[str, dict[str, Any]] = field(default_factory=dict)
    grade: float = 0.0
    friction: tuple[float, float] = (1.0, 1.0)
    car: PlantParameters | None = None
    effects: Effects = NONE

    @property
    def tells_friction(self) -> bool:
        """Whether what the pads alone have says what friction acts: not where an effect is between the two."""
        other = self.effects.without(*BRAKE)
        return np.array_equal(other.theta, self.effects.theta) and len(other.terms) == len(self.effects.terms)

    def plant(self, nominal: PlantParameters, seed: int) -> PlantParameters:
        """The plant of one seed: this condition, and the spread that sensors have in every condition."""
        nominal = self.car or nominal
        rng = np.random.default_rng([seed, 7])
        changes: dict[str, dict[str, Any]] = {}
        for table, entries in self.factors.items():
            for name, factors in entries.items():
                old = getattr(getattr(nominal, table), name)
                new = tuple(v * f for v, f in zip(old, factors, strict=True)) if len(factors) > 1 else old * factors[0]
                changes.setdefault(table, {})[name] = new
        for table, entries_ in self.values.items():
            changes.setdefault(table, {}).update(entries_)
        constant = nominal.motor.torque_constant_nm_a * (1.0 + rng.uniform(-MOTOR_GAIN, MOTOR_GAIN))
        changes.setdefault("motor", {})["torque_constant_nm_a"] = constant
        offset = changes.setdefault("sensor", {}).get(
            "acceleration_offset_mps2", nominal.sensor.acceleration_offset_mps2
        )
        changes["sensor"]["acceleration_offset_mps2"] = (
            offset[0] + ACCELERATION_OFFSET_MPS2 * float(rng.standard_normal()),
            offset[1],
        )
        return override(nominal, changes, f"condition {self.name!r}")

    def road(self, friction: tuple[tuple[float, float], ...] = ()) -> tuple[RoadSegment, ...]:
        """Road with this condition's grade; ``friction`` changes it from positions on: (m, scale)."""
        return tuple(RoadSegment(at, mu, mu, self.grade) for at, mu in ((-1e9, 1.0), *friction))


NOMINAL = Condition("nominal")
_WORN: dict[str, dict[str, tuple[float, ...]]] = {"friction_brake": {"effective_radius_m": (0.97, 0.97)}}
_AFTERMARKET: dict[str, dict[str, tuple[float, ...]]] = {"friction_brake": {"effective_radius_m": (1.0, 0.8)}}

CONDITIONS = (
    NOMINAL,
    Condition("mass +15 %", {"vehicle": {"mass_kg": (1.15,)}}),
    Condition("tyre stiffness -25 %", values={"tyre": {"lkx": 0.75}}),
    Condition("radius -1 %", {"wheel": {"rolling_radius_m": (0.99,)}}),
    Condition("pressure +1 bar", values={"sensor": {"pressure_offset_pa": (1e5,) * 4}}),
    Condition("IMU bias 0.2 m/s2", values={"sensor": {"acceleration_offset_mps2": (0.2, 0.0)}}),
    Condition("grade 3 %", grade=0.03),
    Condition("rear pads -20 %", _AFTERMARKET, friction=(1.0, 0.8)),
    Condition("pad radius -3 %", _WORN, friction=(0.97, 0.97)),
    Condition(
        "all at once",
        {
            "vehicle": {"mass_kg": (1.15,)},
            "wheel": {"rolling_radius_m": (0.99,)},
            "friction_brake": {"effective_radius_m": (0.97, 0.97 * 0.8)},
        },
        {
            "tyre": {"lkx": 0.75},
            "sensor": {"pressure_offset_pa": (1e5,) * 4, "acceleration_offset_mps2": (0.2, 0.0)},
        },
        grade=0.03,
        friction=(0.97, 0.97 * 0.8),
    ),
)


def taught(extension: Path) -> Condition:
    """The paper's car with what a diagnosis taught.

    Raises
    ------
    hil.diagnosis.data.log.UnusableError, hil.scenario.table.ScenarioError, hil.scenario.effects.EffectError
        An extension file that cannot be used, or nothing in it that a simulated car can have.
    """
    with TemporaryDirectory() as folder:
        scenario = load_scenario(str(extended_scenario("stop72", extension, Path(folder))))
    return Condition(f"as {extension.name} taught", car=scenario.plant, effects=scenario.effects)

"""Demands that a tester sets in the law's place: pressure and motor of each wheel, while the car stands."""

import math
import struct
from typing import NamedTuple

from ecu.diagnostics.exchange import View
from ecu.diagnostics.protocol import Nrc, Refused
from ecu.law.types import UNKNOWN, Four

MOST_PRESSURE_PA = 60e5  # choice: what holds the car on any grade, a third of what the brake can
MOST_MOTOR_NM = 50.0  # choice: enough for a current to be seen; braking only, a test drives no car
RETURN, FREEZE, ADJUST = 0x00, 0x02, 0x03


class Demand(NamedTuple):
    """One identifier of InputOutputControl: a 32-bit float in SI units between its bounds."""

    name: str
    unit: str
    motor: bool
    wheel: int
    low: float
    high: float


DEMANDS: dict[int, Demand] = {
    did + i: Demand(f"{name}_{wheel}", unit, motor, i, low, high)
    for did, name, unit, motor, low, high in (
        (0x4000, "pressure_demand", "Pa", False, 0.0, MOST_PRESSURE_PA),
        (0x4010, "motor_demand", "Nm", True, -MOST_MOTOR_NM, 0.0),
    )
    for i, wheel in enumerate(("fl", "fr", "rl", "rr"))
}


def law_value(one: Demand, view: View) -> float:
    """What the law asks for."""
    return (view.outputs.motor_demand_nm if one.motor else view.outputs.pressure_demand_pa)[one.wheel]


class Actuators:
    """The demands that are set; empty while the law has them all."""

    def __init__(self) -> None:
        self._set: dict[int, float] = {}

    @property
    def active(self) -> bool:
        """Some demand is not the law's."""
        return bool(self._set)

    def release(self) -> None:
        """Give all of them back to the law."""
        self._set.clear()

    def read(self, did: int, view: View) -> bytes:
        """The demand as it is sent."""
        return struct.pack(">f", self._set.get(did, law_value(DEMANDS[did], view)))

    def control(self, did: int, option: int, data: bytes, view: View) -> bytes:
        """Answer to one request behind the identifier; Refused where it must not be."""
        one = DEMANDS[did]
        if option not in (RETURN, FREEZE, ADJUST):
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        if len(data) != (4 if option == ADJUST else 0):
            raise Refused(Nrc.INCORRECT_LENGTH)
        if option == RETURN:
            self._set.pop(did, None)
            return self.read(did, view)
        if option == ADJUST:
            (value,) = struct.unpack(">f", data)
        else:
            (value,) = struct.unpack(">f", self.read(did, view))
        if not one.low <= value <= one.high:  # NaN too
            raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
        if not view.actuators_free:
            raise Refused(Nrc.CONDITIONS_NOT_CORRECT)
        self._set[did] = value
        return self.read(did, view)

    def demands(self) -> tuple[Four | None, Four | None]:
        """Pressures and motor torques in the law's place, NaN of a wheel that stays the law's."""
        pressure, motor = list(UNKNOWN), list(UNKNOWN)
        for did, value in self._set.items():
            one = DEMANDS[did]
            (motor if one.motor else pressure)[one.wheel] = value
        return _four(pressure), _four(motor)


def _four(values: list[float]) -> Four | None:
    a, b, c, d = values
    return None if all(math.isnan(value) for value in values) else (a, b, c, d)

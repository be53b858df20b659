"""Units that a column may have, and which of them measure what a channel holds."""

from collections.abc import Mapping
from typing import Final

DEG: Final = 0.017453292519943295
RPM: Final = 0.10471975511965977

_SPEED: Final = {
    "m/s": 1.0, "km/h": 1.0 / 3.6, "kmph": 1.0 / 3.6, "kph": 1.0 / 3.6, "mph": 0.44704, "knots": 0.514444,
}  # fmt: skip
_TURNING: Final = {
    "rad/s": 1.0, "deg/s": DEG, "°/s": DEG, "rpm": RPM, "1/min": RPM, "rev/s": 6.283185307179586, "mrad/s": 1e-3,
}  # fmt: skip
_ACCELERATION: Final = {"m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "g": 9.80665, "mg": 9.80665e-3}
_PRESSURE: Final = {
    "pa": 1.0, "kpa": 1e3, "mpa": 1e6, "bar": 1e5, "mbar": 1e2, "hpa": 1e2, "psi": 6894.757293168,
}  # fmt: skip
_TORQUE: Final = {"nm": 1.0, "n m": 1.0, "n.m": 1.0, "n·m": 1.0, "knm": 1e3, "kn m": 1e3}
_ANGLE: Final = {"rad": 1.0, "deg": DEG, "°": DEG, "mrad": 1e-3}
_SHARE: Final = {"1": 1.0, "-": 1.0, "%": 0.01}
TIME: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}

OF_CHANNEL: Final[Mapping[str, Mapping[str, float]]] = {
    "wheel_speed": _TURNING, "pressure": _PRESSURE, "motor_torque": _TORQUE, "ax": _ACCELERATION,
    "ay": _ACCELERATION, "yaw_rate": _TURNING, "steer": _ANGLE, "pedal": _SHARE, "throttle": _SHARE, "soc": _SHARE,
    "speed": _SPEED,
}  # fmt: skip
"""Stem of a channel's name -> unit -> factor to SI."""
USUAL: Final[Mapping[str, str]] = {
    "wheel": "rpm", "pressure": "bar", "motor": "knm", "ax": "g", "ay": "g", "yaw": "deg/s", "steer": "deg",
    "pedal": "%", "throttle": "%", "soc": "%", "speed": "km/h",
}  # fmt: skip
"""First word of a channel's name -> the unit that it is most often logged in besides SI."""
ROAD_SPEED: Final = frozenset(_SPEED)
"""Units of a wheel speed that was measured as a speed of the road: it needs the rolling radius besides."""
TO_SI: Final[Mapping[str, tuple[float, float]]] = {
    "": (1.0, 0.0), "k": (1.0, 0.0), "degc": (1.0, 273.15),
    **{unit: (factor, 0.0) for units in (*OF_CHANNEL.values(), TIME) for unit, factor in units.items()},
}  # fmt: skip
"""Unit, lower case -> factor and offset to SI."""
_WRITTEN: Final = {
    "pa": "Pa", "kpa": "kPa", "mpa": "MPa", "hpa": "hPa", "nm": "N m", "n m": "N m", "knm": "kN m",
}  # fmt: skip


def units_of(channel: str) -> Mapping[str, float]:
    """Units that measure what a channel holds, with their factors to SI."""
    return next((units for stem, units in OF_CHANNEL.items() if channel.startswith(stem)), {})


def written(unit: str) -> str:
    """A unit as people write it."""
    return _WRITTEN.get(unit, unit)

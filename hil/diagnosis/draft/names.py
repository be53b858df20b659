"""What the names and units of signals say: kind of quantity, wheel, demanded or measured."""

import re
from collections.abc import Mapping
from typing import Final

from hil.diagnosis.data.units import OF_CHANNEL, TO_SI

_WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_CORNERS: Final = {
    "fl": "fl", "lf": "fl", "vl": "fl", "fr": "fr", "rf": "fr", "vr": "fr", "rl": "rl", "lr": "rl", "hl": "rl",
    "rr": "rr", "hr": "rr",
}  # fmt: skip
"""Two letters of a wheel -> our name of it; v and h are German for front and rear."""
_FRONT: Final = {"front", "frnt", "vorn", "vorne", "vo"}
_REAR: Final = {"rear", "hinten", "hi", "back"}
_LEFT: Final = {"left", "links", "li", "le", "lft", "l"}
_RIGHT: Final = {"right", "rechts", "re", "ri", "rgt", "r"}

_OF_KIND: Final[Mapping[str, frozenset[str]]] = {
    "wheel": frozenset({"wheel", "wheels", "whl", "wss", "ws", "raddrehzahl", "rads"}),
    "speed": frozenset({"speed", "spd", "v", "vel", "velocity", "vx", "kmh", "kph", "gps", "vehspd"}),
    "ax": frozenset({"ax", "accx", "xacc", "longitudinal", "long", "laengs", "along"}),
    "ay": frozenset({"ay", "accy", "yacc", "lateral", "lat", "quer", "across"}),
    "az": frozenset({"az", "accz", "vertical", "vert"}),
    "yaw": frozenset({"yaw", "yawrate", "gier", "gierrate", "gyro", "wz", "omega"}),
    "steer": frozenset({"steer", "steering", "swa", "sas", "lenk", "lenkwinkel", "delta", "handwheel"}),
    "pressure": frozenset({"pressure", "press", "prs", "pres", "druck", "bremsdruck", "cyl", "pbrk"}),
    "torque": frozenset({"torque", "trq", "tq", "moment", "mom"}),
    "throttle": frozenset({"throttle", "accelerator", "gas", "aped", "tps", "app", "fahrpedal"}),
    "pedal": frozenset({"pedal", "bped", "bremspedal"}),
    "soc": frozenset({"soc"}),
    "demand": frozenset({
        "dem", "demand", "cmd", "command", "target", "tgt", "soll", "req", "request", "setpoint", "desired", "des",
    }),
}  # fmt: skip
"""Kind -> words of a name, lower case."""
_ACCELERATION = frozenset({"acc", "accel", "acceleration", "beschl", "beschleunigung", "a"})
_SPELLED: Final = {
    "m/s/s": "m/s2", "m/sec^2": "m/s2", "m/sec2": "m/s2", "mps2": "m/s2", "m/s^2": "m/s2", "m/s²": "m/s2",
    "ms-2": "m/s2", "gravity": "g", "km/hr": "km/h", "kmh": "km/h", "kmph": "km/h", "kph": "km/h", "miles/h": "mph",
    "mps": "m/s", "m/sec": "m/s", "deg/sec": "deg/s", "degps": "deg/s", "degree/s": "deg/s", "°/s": "deg/s",
    "degrees": "deg", "degree": "deg", "°": "deg", "rad/sec": "rad/s", "radps": "rad/s", "1/min": "rpm",
    "u/min": "rpm", "r/min": "rpm", "n.m": "nm", "n·m": "nm", "n-m": "nm", "bars": "bar", "percent": "%", "pct": "%",
}  # fmt: skip
"""Spellings of units -> ours."""


def words(name: str) -> tuple[str, ...]:
    """Words of a name in lower case, the message's first: WhlFl_W_Meas -> whl, fl, w, meas."""
    return tuple(word.lower() for word in _WORDS.findall(name))


def known_unit(unit: str) -> str:
    """A stated unit as the readers know it; empty where they do not, or where none is stated."""
    name = unit.strip().lower().replace(" ", "")
    name = _SPELLED.get(name, name)
    return name if name in TO_SI and name not in ("", "1", "-") else ""


def wheel_of(name: str) -> str:
    """Wheel that a name says, ``fl``, ``fr``, ``rl``, ``rr``; empty where it says none."""
    found = words(name.rpartition(".")[2])
    for word in reversed(found):
        if word in _CORNERS:
            return _CORNERS[word]
    joined = "".join(found)
    end = "f" if _FRONT & set(found) or "front" in joined else "r" if _REAR & set(found) or "rear" in joined else ""
    side = "l" if _LEFT & set(found) or "left" in joined else "r" if _RIGHT & set(found) or "right" in joined else ""
    return end + side if end and side else ""


def kinds(name: str, unit: str) -> set[str]:
    """Kinds of quantity that a name and its unit allow; empty where they say nothing."""
    own, whole = set(words(name.rpartition(".")[2])), set(words(name))
    found = {kind for kind, known in _OF_KIND.items() if known & own}
    found = found or {kind for kind, known in _OF_KIND.items() if known & whole}
    if _ACCELERATION & whole and not found & {"throttle", "pedal"}:
        axis = {"ax": "x", "ay": "y", "az": "z"}
        found |= {kind for kind, letter in axis.items() if letter in own}
    if "brake" in whole and known_unit(unit) in OF_CHANNEL["pressure"]:
        found.add("pressure")
    if "wheel" in found and "steer" in found:
        found.discard("wheel")
    return found


def quantity(unit: str) -> str:
    """Quantity of a stated unit, by the stem of a channel that has it; empty where none is stated."""
    name = known_unit(unit)
    order = ("ax", "pressure", "motor_torque", "speed", "yaw_rate", "steer", "pedal")
    return next((stem for stem in order if name in OF_CHANNEL[stem]), "") if name else ""

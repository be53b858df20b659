"""Causes in words: what is wrong, where, by how much, with the 95 % interval. No names of the JSON in it."""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from hil.diagnosis.result.effect_phrases import PHRASES
from plant.injection.theta import THETA
from plant.injection_points import INJECTION_POINTS

PLACES: Final = {
    "car": "all", "front": "front", "rear": "rear", "left": "left", "right": "right",
    "fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right",
}  # fmt: skip
_NODES: Final = {
    "wheel": "wheel speeds", "imu": "accelerations and yaw rate", "pressure": "pressures", "motor": "motor torques",
    "driver": "pedal travels",
}  # fmt: skip
_COEFFICIENTS: Final = ("aero_lift.coefficient", "mu_pressure.exponent", "load_sensitivity.per_load")
"""Numbers without a unit that are no share."""
_UNITS: Final[Mapping[str, tuple[float, str]]] = {
    "": (100.0, "%"), "s": (1e3, "ms"), "Pa": (1e-5, "bar"), "rad": (180.0 / np.pi, "°"), "m/s": (3.6, "km/h"),
    "rad/s": (180.0 / np.pi, "°/s"), "1/K": (100.0, "% per K"), "s/m": (100.0, "% per m/s"), "1/s": (100.0, "% per s"),
    "1/MJ": (100.0, "% per MJ"), "m3": (1e6, "cm³"), "m/N": (1e6, "mm per kN"), "m": (1e3, "mm"), "m/s2": (1.0, "m/s²"),
    "m/s3": (1.0, "m/s³"), "kg m2": (1.0, "kg m²"), "Pa/K": (1e-5, "bar per K"), "Pa s": (1e-5, "bar s"),
}  # fmt: skip
"""By unit of the parameter: factor, and unit for people."""
_SIGNS = re.compile(r"\[([^|\]]*)\|([^|\]]*)\]")
_VARIABLE_WORDS: Final = {
    "speed": "the speed", "wheel_speed": "the wheel's speed", "pressure": "the pressure",
    "disc_temperature": "the disc's temperature", "time_since_on": "the time since the brakes were applied",
    "time": "the time in the log", "motor_torque": "the motor torque", "acceleration": "the acceleration",
    "yaw_rate": "the yaw rate", "distance": "the way",
}  # fmt: skip


def sentence(cause: Mapping[str, Any], interval: bool = True) -> str:
    """A cause or rival of the JSON in words, with its onset."""
    if cause["curve"]:
        text = _unlisted(cause)
    else:
        numbers = dict(cause["parameters"])
        shapes = {name: entry for name, entry in numbers.items() if _is_shape(cause["effect"], name)}
        strengths = {name: entry for name, entry in numbers.items() if name not in shapes}
        text = ", ".join(_strength(cause, name, entry, shapes, interval) for name, entry in strengths.items())
    return text + onset(cause)


def number_sentence(cause: Mapping[str, Any], name: str) -> str:
    """One number of a cause in words, with its 95 % interval; empty for what only shapes the cause, and for curves."""
    if cause["curve"] or _is_shape(cause["effect"], name):
        return ""
    return _strength(cause, name, cause["parameters"][name], cause["parameters"], interval=True)


def onset(cause: Mapping[str, Any]) -> str:
    """From when on a cause acts; empty where it always does."""
    at = cause["onset"]
    return "" if at is None else f", from {at['t_s']:.1f} s of {at['log']} on"


def place(location: str) -> str:
    """A location in words."""
    return PLACES.get(location, _NODES.get(location, location.replace("_", " ")))


def shown_unit(unit: str, share: bool = True) -> tuple[float, str]:
    """Factor to the unit for people, and that unit; a number without one is a share, or a coefficient."""
    return _UNITS.get(unit, (1.0, unit)) if unit or share else (1.0, "")


def _is_shape(effect: str, name: str) -> bool:
    return THETA.effect(effect).parameter(name).shape


def _strength(
    cause: Mapping[str, Any], name: str, entry: Mapping[str, Any], shapes: Mapping[str, Any], interval: bool
) -> str:
    key, value = f"{cause['effect']}.{name}", float(entry["value"])
    fallback = f"{cause['title']}, {place(cause['location'])}: {name.replace('_', ' ')} {{n+}}"
    template = PHRASES.get(key, fallback)
    as_factor, one_sided = "{f}" in template, "[" in template
    factor, unit = (1.0, "") if as_factor else shown_unit(entry["unit"], key not in _COEFFICIENTS)
    size, low, high = (as_factor + factor * v for v in (value, *entry["ci95"]))
    if one_sided and value < 0.0:  # the words have the sign
        size, low, high = -size, -high, -low
    digits = _digits(high - low)
    unsigned = _with_unit(abs(size), digits, unit)
    words = {"at": place(cause["location"]), "n": unsigned, "n+": _with_unit(size, digits, unit), "f": f"{size:.3g}"}
    for one in THETA.effect(cause["effect"]).parameters:
        if one.shape:
            words[one.name] = f"{shapes[one.name]['value'] if one.name in shapes else one.typical:.0f} {one.unit}"
    text = _SIGNS.sub(lambda signs: signs[1 if value >= 0.0 else 2], template)
    for word, shown in words.items():
        text = text.replace("{" + word + "}", shown)
    text = text[0].upper() + text[1:]
    return f"{text} (95 %: {low:.{digits}f} to {_with_unit(high, digits, unit)})" if interval else text


def _digits(width: float) -> int:
    """Decimal places that an interval of this width allows."""
    return min(max(0, -int(np.floor(np.log10(max(0.5 * width, 1e-9))))), 6)


def _with_unit(value: float, digits: int, unit: str) -> str:
    return f"{value:.{digits}f}{'' if unit.startswith('°') or not unit else ' '}{unit}"


def _unlisted(cause: Mapping[str, Any]) -> str:
    """Where an unlisted cause acts and what it depends on."""
    (variable,) = cause["variables"]
    what = INJECTION_POINTS[cause["injection_point"]][2].split(",")[0]
    where = "" if cause["location"] == "car" else f" ({place(cause['location'])})"
    return f"An unlisted cause acts on the {what}{where} and depends on {_VARIABLE_WORDS.get(variable, variable)}"

"""Checks of a vehicle set's entries: each refusal names the key, what is expected, what is there and what to do."""

import typing
from functools import cache
from typing import Any

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.vehicle.keys import split_name
from hil.scenario.parameters import ParameterError, is_number, override
from plant.parameters.plant import PlantParameters
from plant.vectors import PARAMETER

_REMEDY = "write it in SI units, or leave the key out"
_RISING = (
    ("motor", "fade_end_mps", "fade_start_mps"),
    ("motor", "derating_start_k", "derating_end_k"),
    ("battery", "taper_start_soc", "taper_end_soc"),
)
"""Section, and two limits in it of which the second is the larger: the plant divides by their difference."""


def checked_number(value: Any, key: str, where: str) -> float:
    """One finite number.

    Raises
    ------
    UnusableError
        A list, a text, a truth value, NaN or infinity.
    """
    if not is_number(value):
        raise UnusableError(f"{where}: {key}: expected a number, got {value!r}; {_REMEDY}")
    return float(value)


def checked_numbers(value: Any, key: str, where: str) -> Any:
    """One finite number, or a list of some, as it is.

    Raises
    ------
    UnusableError
        No number, or a list with something else in it.
    """
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(map(is_number, numbers)):
        raise UnusableError(f"{where}: {key}: expected a number, got {value!r}; {_REMEDY}")
    return value


def checked_tolerance(value: Any, key: str, where: str, most: int = 1) -> float:
    """The larger of the half-widths; a list has as many as there are values, ``most``.

    Raises
    ------
    UnusableError
        No number, a negative one, or too many or few of them.
    """
    numbers = checked_numbers(value, key, where)
    numbers = numbers if isinstance(numbers, list) else [numbers]
    if len(numbers) not in (1, most):
        expected = "one number" if most == 1 else f"one number or {most}"
        raise UnusableError(f"{where}: {key}: expected {expected}, got {value!r}; write the larger half-width")
    if min(numbers) < 0.0:
        raise UnusableError(f"{where}: {key}: expected a half-width of 0 or more, got {value!r}; 0 says: known exactly")
    return float(max(numbers))


def check_bounds(base: PlantParameters, name: str, key: str, value: Any, where: str) -> None:
    """Refuse a value outside the bounds of the plant's parameter ``name``, as it is written under ``key``.

    Raises
    ------
    UnusableError
        Outside its bounds; a list of wrong length.
    """
    if name.startswith("brake_gain") and not value > 0.0:
        raise UnusableError(f"{where}: {key}: expected more than 0 N m/Pa, got {value!r}; {_REMEDY}")
    if name not in PARAMETER.sizes:
        return
    section, short = split_name(name)
    members = getattr(getattr(base, section), short)
    if isinstance(members, tuple) and not isinstance(value, list):
        value = [value] * len(members)
    try:
        override(getattr(base, section), {short: value}, where)
    except ParameterError as error:
        text = str(error).removeprefix(f"{where}.{short}")
        raise UnusableError(f"{where}: {key}{'' if key == name else f' (sets {name})'}{text}; {_REMEDY}") from error


@cache
def lowest(name: str) -> float:
    """Lower bound of a parameter of the plant, by its flat name."""
    section, short = split_name(name)
    kind = typing.get_type_hints(PlantParameters)[section]
    return float(typing.get_type_hints(kind, include_extras=True)[short].__metadata__[1])


def check_order(parameters: PlantParameters, where: str) -> None:
    """Refuse limits in the wrong order, and pads without friction.

    Raises
    ------
    UnusableError
        The end of a range is not above its start; pads without friction at rest (a T / (b epsilon)).
    """
    for section, lower, upper in _RISING:
        low, high = (getattr(getattr(parameters, section), name) for name in (lower, upper))
        if not low < high:
            raise UnusableError(
                f"{where}: {section}_{upper}: expected more than {section}_{lower}, {low:g}, got {high:g}; "
                "state both, or neither"
            )
    pad = parameters.pad
    if not (pad.a_1_ks > 0.0 and pad.b_1_j > 0.0):
        raise UnusableError(
            f"{where}: pad_a_1_ks, pad_b_1_j: expected values that give friction, more than 0 each, got {pad.a_1_ks:g} "
            f"and {pad.b_1_j:g}; leave all pad_ keys out for a constant friction"
        )

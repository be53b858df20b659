"""The one reader of parameter files: TOML sets into frozen dataclasses, refusing what does not fit.

A set has one table per dataclass field that is itself a dataclass; every number is written
``name = { value = 1463.0, unit = "kg", tolerance = 75.0, source = "..." }``. The dataclass annotates what it
accepts: ``mass_kg: Annotated[float, "kg", 500.0, 5000.0]`` (unit, lowest, highest), a tuple of numbers likewise,
or a ``Literal`` for a named choice.
"""

import dataclasses
import sys
import tomllib
import typing
from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from hil.errors import BrakebenchError, unknown_keys

T = TypeVar("T")
_ENTRY_KEYS = {"value", "unit", "tolerance", "source"}


class ParameterError(BrakebenchError):
    """A parameter file that cannot be used as it is."""


def load_set(path: Path | Traversable, kind: type[T]) -> T:
    """Read a parameter set.

    Parameters
    ----------
    path : TOML file.
    kind : frozen dataclass to build.

    Raises
    ------
    ParameterError
        Unreadable file; unknown, missing or doubled key; wrong unit; value of the wrong type or out of bounds;
        a number without source or tolerance. The message names file and key.
    """
    return _build(kind, _read(path), str(path), "")


def override(value: T, changes: Mapping[str, Any], where: str) -> T:
    """Copy of a parameter set with some numbers replaced.

    Parameters
    ----------
    changes : nested tables of plain values, e.g. ``{"vehicle": {"mass_kg": 1600.0}}``, in the set's own units.
    where : file and table the changes come from, for messages.
    """
    hints = typing.get_type_hints(type(value), include_extras=True)
    new: dict[str, Any] = {}
    for key, change in changes.items():
        if odd := unknown_keys([key], set(hints)):
            raise ParameterError(f"{where}: {odd}")
        old = getattr(value, key)
        if dataclasses.is_dataclass(old):
            if not isinstance(change, Mapping):
                raise ParameterError(f"{where}.{key}: expected a table, got {change!r}")
            new[key] = override(old, change, f"{where}.{key}")
        else:
            new[key] = _check(change, hints[key], f"{where}.{key}")
    return dataclasses.replace(value, **new)  # type: ignore[type-var]  # any dataclass: mypy has no such type


def _read(path: Path | Traversable) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read ({error.strerror}); give the path of a parameter set") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path}: not valid TOML: {error}") from error


def _build(kind: type[T], table: Mapping[str, Any], file: str, prefix: str) -> T:
    hints = typing.get_type_hints(kind, include_extras=True)
    for key in table:
        if odd := unknown_keys([prefix + key], {prefix + name for name in hints}):
            raise ParameterError(f"{file}: {odd}")
    missing = sorted(set(hints) - set(table))
    if missing:
        raise ParameterError(
            f"{file}: missing {', '.join(prefix + name for name in missing)}; add each with its source"
        )
    values: dict[str, Any] = {}
    for name, hint in hints.items():
        entry = table[name]
        if dataclasses.is_dataclass(hint) and isinstance(hint, type):
            if not isinstance(entry, Mapping):
                raise ParameterError(f"{file}: {prefix}{name}: expected a table, got {entry!r}")
            values[name] = _build(hint, entry, file, f"{prefix}{name}.")
        else:
            values[name] = _entry(entry, hint, f"{file}: {prefix}{name}")
    return kind(**values)


def _entry(entry: Any, hint: Any, where: str) -> Any:
    if not isinstance(entry, Mapping) or "value" not in entry or set(entry) - _ENTRY_KEYS:
        raise ParameterError(f"{where}: expected {{ value, unit, tolerance, source }}, got {entry!r}")
    if not isinstance(entry.get("source"), str) or not entry["source"]:
        raise ParameterError(f"{where}: has no source; say where the number is from")
    if typing.get_origin(hint) is Annotated:
        unit = hint.__metadata__[0]
        if entry.get("unit") != unit:
            raise ParameterError(f"{where}: expected unit {unit!r}, got {entry.get('unit')!r}; convert the value")
        tolerance = entry.get("tolerance")
        if tolerance is None or not is_number(tolerance) or tolerance < 0:
            raise ParameterError(f"{where}: expected a tolerance >= 0 in {unit!r} (half width), got {tolerance!r}")
    return _check(entry["value"], hint, where)


def is_number(value: Any) -> bool:
    """Whether a value is a finite number that a float holds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _check(value: Any, hint: Any, where: str) -> Any:
    """Value as the annotation wants it; bounds are inclusive."""
    origin = typing.get_origin(hint)
    if origin is Literal:
        if value not in typing.get_args(hint):
            raise ParameterError(
                f"{where}: expected one of {', '.join(map(repr, typing.get_args(hint)))}, got {value!r}"
            )
        return value
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            raise ParameterError(f"{where}: expected a {hint.__name__}, got {value!r}")
        return value
    if origin is not Annotated:
        raise TypeError(f"{where}: the annotation {hint!r} gives no unit and bounds")
    kind, (unit, low, high) = typing.get_args(hint)[0], hint.__metadata__
    if typing.get_origin(kind) is tuple:
        sizes = typing.get_args(kind)
        if not isinstance(value, list | tuple) or (sizes[-1] is not Ellipsis and len(value) != len(sizes)):
            count = "" if sizes[-1] is Ellipsis else f"{len(sizes)} "
            raise ParameterError(f"{where}: expected a list of {count}numbers in {unit!r}, got {value!r}")
        return tuple(_number(v, sizes[0], unit, low, high, f"{where}[{i}]") for i, v in enumerate(value))
    return _number(value, kind, unit, low, high, where)


def _number(value: Any, kind: type, unit: str, low: float, high: float, where: str) -> Any:
    if not is_number(value) or (kind is int and not isinstance(value, int)):
        raise ParameterError(f"{where}: expected a {'whole number' if kind is int else 'number'}, got {value!r}")
    if not low <= value <= high:
        raise ParameterError(f"{where}: expected {low:g} to {high:g} {unit}, got {value!r}")
    return kind(value)

"""Named places in flat vectors, so that no equation reads ``x[3]``."""

import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def constants(name: str, sizes: Mapping[str, int]) -> ModuleType:
    """First index of each part, as a module: the numbers of one are plain constants to the compiler."""
    module, start = ModuleType(name), 0
    for part, size in sizes.items():
        setattr(module, part, start)
        start += size
    return module


class Layout:
    """Names, sizes and offsets of the parts of a flat vector.

    Attributes
    ----------
    sizes : part name -> number of elements, in order.
    at : first index of each part by name, a constant to compiled code (``x[X.speed_mps]``).
    size : total length.
    """

    def __init__(self, name: str, sizes: Mapping[str, int]) -> None:
        self.sizes = dict(sizes)
        self.at: Any = constants(name, self.sizes)
        self.size = sum(self.sizes.values())

    def slice(self, part: str) -> slice:
        """Where a part lies."""
        start: int = getattr(self.at, part)
        return slice(start, start + self.sizes[part])

    def zeros(self) -> Vector:
        """A vector of zeros."""
        return np.zeros(self.size)

    def columns(self) -> list[str]:
        """One name for each element: ``part``, or ``part_fl .. part_rr`` for four, ``part_front/_rear`` for two."""
        suffixes = {2: ("_front", "_rear"), 4: ("_fl", "_fr", "_rl", "_rr")}
        names: list[str] = []
        for part, size in self.sizes.items():
            endings = suffixes.get(size) or tuple(f"_{i}" for i in range(size))
            names += [part] if size == 1 else [part + ending for ending in endings]
        return names


def _flatten(value: Any, prefix: str, into: dict[str, tuple[float, ...]]) -> None:
    for field in fields(value):
        part = getattr(value, field.name)
        if is_dataclass(part):
            _flatten(part, f"{prefix}{field.name}_", into)
        elif isinstance(part, tuple):
            into[prefix + field.name] = tuple(float(v) for v in part)
        else:
            into[prefix + field.name] = (float(part),)


def flatten(value: Any) -> dict[str, tuple[float, ...]]:
    """Numbers of a nested dataclass by name: ``{"vehicle_mass_kg": (1463.0,), ...}``."""
    into: dict[str, tuple[float, ...]] = {}
    _flatten(value, "", into)
    return into


def dataclass_sizes(kind: type, prefix: str = "") -> dict[str, int]:
    """Sizes of the parts that `flatten` gives for a dataclass, from its annotations alone."""
    sizes: dict[str, int] = {}
    for name, hint in typing.get_type_hints(kind).items():
        if is_dataclass(hint):
            sizes |= dataclass_sizes(typing.cast(type, hint), f"{prefix}{name}_")
        elif typing.get_origin(hint) is tuple:
            sizes[prefix + name] = len(typing.get_args(hint))
        else:
            sizes[prefix + name] = 1
    return sizes

"""The controller's parameters one by one: their identifiers, how they are read, and which may be written."""

import dataclasses
import math
import struct
import typing
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from ecu.diagnostics.protocol import Nrc, Refused
from ecu.parameters.ecu import EcuParameters

FIRST_DID = 0x1000  # + 0x100 for each table + 1 for each of its values, in the order of the parameter set
WRITABLE_TABLES = ("blend", "compensation")
_NOT_WRITABLE = ("blending_factor",)  # that of the set is used at the start only
_NUMBER = 8  # bytes


class Parameter(NamedTuple):
    """One value of the set: so many ``numbers`` of 64 bits, or a text of so many ``letters`` where there are none."""

    table: str
    name: str
    unit: str
    whole: bool
    low: float
    high: float
    numbers: int
    writable: bool
    letters: int = 0

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return _NUMBER * self.numbers + self.letters


def _parameters() -> Iterator[tuple[int, Parameter]]:
    for i, (table, kind) in enumerate(typing.get_type_hints(EcuParameters).items()):
        hints = typing.get_type_hints(kind, include_extras=True)
        for k, (name, hint) in enumerate(hints.items()):
            writable = table in WRITABLE_TABLES and name not in _NOT_WRITABLE
            if typing.get_origin(hint) is Annotated:
                value, (unit, low, high) = typing.get_args(hint)[0], hint.__metadata__
                count = len(typing.get_args(value)) if typing.get_origin(value) is tuple else 1
                one = Parameter(table, name, unit, value is int, low, high, count, writable and count == 1)
            elif hint is bool:
                one = Parameter(table, name, "1", True, 0, 1, 1, False)
            else:
                letters = max(map(len, typing.get_args(hint)))
                one = Parameter(table, name, "", False, 0.0, 0.0, 0, False, letters)
            yield FIRST_DID + 0x100 * i + k, one


PARAMETERS: dict[int, Parameter] = dict(_parameters())


def read(one: Parameter, parameters: EcuParameters) -> bytes:
    """Value as on the wire."""
    value: Any = getattr(getattr(parameters, one.table), one.name)
    if isinstance(value, str):
        return value.ljust(one.letters).encode("ascii")
    values = value if isinstance(value, tuple) else (value,)
    return struct.pack(f">{len(values)}d", *values)


def written(one: Parameter, parameters: EcuParameters, data: bytes) -> EcuParameters:
    """Parameter set with one value replaced; Refused where it is out of its bounds or does not go with the others."""
    if len(data) != one.size:
        raise Refused(Nrc.INCORRECT_LENGTH)
    (value,) = struct.unpack(">d", data)
    if not (math.isfinite(value) and one.low <= value <= one.high) or (one.whole and value != int(value)):
        raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
    table = dataclasses.replace(getattr(parameters, one.table), **{one.name: int(value) if one.whole else value})
    changed = dataclasses.replace(parameters, **{one.table: table})
    blend, learning = changed.blend, changed.compensation
    if blend.fade_start_mps <= blend.fade_end_mps or learning.friction_lowest >= learning.friction_highest:
        raise Refused(Nrc.REQUEST_OUT_OF_RANGE)
    return changed

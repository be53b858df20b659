"""What is known of our own ECU by name: its identifiers on the bus, data identifiers, codes, routines."""

import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

from dbc import diagnostic_ids
from dbc.contract import spec_of
from dbc.messages import BrakeMode, BrakeStatus
from ecu.diagnostics import routines
from ecu.diagnostics.actuators import DEMANDS
from ecu.diagnostics.identifiers import FIRST_QUANTITY, IDENTIFIERS
from ecu.diagnostics.identifiers import Identifier as DataIdentifier
from ecu.diagnostics.quantities import QUANTITIES, RECORD_BYTES
from ecu.diagnostics.security import REQUEST_SEED
from ecu.diagnostics.services import EXTENDED_RECORDS
from ecu.diagnostics.trouble_memory import dtc_of
from ecu.law.trouble_codes import CODES
from hil.errors import BrakebenchError
from hil.uds.addresses import Identifier
from hil.uds.known import FOREIGN, Did, Names, named, value_text

REQUEST, ANSWER = Identifier(diagnostic_ids.REQUEST, False), Identifier(diagnostic_ids.RESPONSE, False)
FUNCTIONAL, PERIODIC = Identifier(diagnostic_ids.REQUEST_FUNCTIONAL, False), Identifier(diagnostic_ids.PERIODIC, False)
LEVEL = (REQUEST_SEED + 1) // 2
"""Level of security access."""
SIGN = Identifier(spec_of(BrakeStatus).can_id, False)
"""Our ECU is on a bus where this message is."""
_MODES: dict[int, str] = {mode: mode.name for mode in BrakeMode}
_STATES: dict[int, str] = {state: state.name.lower().replace("_", " ") for state in routines.State}
_RECORDS = {"fault detection counter": lambda data: str(int.from_bytes(data, "big", signed=True))}


def _number(value: float, name: str) -> str:
    if name.endswith("mode") and value in _MODES:
        return _MODES[int(value)]
    return f"{value:.7g}"


def _value(form: str, unit: str, name: str) -> Callable[[bytes], str]:
    shown = "" if unit in ("", "1") else f" {unit}"
    first = 1 if form == ">Bf" else 0  # in front of a quantity stands the tick it is of

    def read(data: bytes) -> str:
        numbers = struct.unpack(form, data)[first:]
        return ", ".join(_number(number, name) for number in numbers) + shown

    return read


def _coded(form: str, name: str) -> Callable[[str], bytes]:
    """Bytes of a number as it is typed; the ECU says whether it may be."""

    def code(text: str) -> bytes:
        try:
            return struct.pack(form, float(text))
        except (ValueError, OverflowError, struct.error):
            raise BrakebenchError(f"{name}: expected a number, got {text!r}") from None

    return code


def _dids() -> Iterator[tuple[int, Did]]:
    for did, one in IDENTIFIERS.items():
        yield did, _did(one)
    for did, demand in DEMANDS.items():
        yield did, Did(demand.name, 4, _value(">f", demand.unit, demand.name), _coded(">f", demand.name))


def _did(one: DataIdentifier) -> Did:
    if one.form == "text":
        return Did(one.name, one.size or None, value_text)
    if one.form == "3B":
        return Did(one.name, one.size, lambda data: data.hex("-"))
    coded = _coded(one.form, one.name) if one.form == ">1d" else None
    return Did(one.name, one.size, _value(one.form, one.unit, one.name), coded)


def _routine(number: int) -> Did:
    def value(data: bytes) -> str:
        state, results = named(_STATES, data[0]), data[1:]
        if number == routines.SELF_TEST and len(results) == 4:
            supplied, codes, mode = struct.unpack(">HBB", results)
            return f"{state}, sources supplied 0x{supplied:03X}, active codes {codes}, mode {named(_MODES, mode)}"
        if number == routines.PRESSURE_ZERO and len(results) == 16:
            return f"{state}, {', '.join(f'{pressure:.7g}' for pressure in struct.unpack('>4f', results))} Pa"
        return f"{state}, {results.hex(' ')}" if results else state

    return Did(routines.NAMES[number], None, value)


OWN = Names(
    dids=dict(_dids()),
    dtcs={dtc_of(code): code.name for code in CODES},
    routines={number: _routine(number) for number in routines.NAMES},
    records={record: Did(name, 1, _RECORDS.get(name)) for record, name in EXTENDED_RECORDS.items()},
    periodic={FIRST_QUANTITY & 0xFF | k: FIRST_QUANTITY + k for k in range(len(QUANTITIES))},
)
"""All that our ECU calls by name."""


class Sample(NamedTuple):
    """A quantity of the law as one periodic frame tells it; ``tick`` is the low byte of the law's tick number."""

    name: str
    tick: int
    value: float


def sample_of(data: bytes) -> Sample | None:
    """Read a periodic frame; None where it is none of ours."""
    if len(data) <= RECORD_BYTES or data[0] >= len(QUANTITIES):
        return None
    tick, value = struct.unpack_from(">Bf", data, 1)
    return Sample(QUANTITIES[data[0]].name, tick, value)


def names_of(identifier: Identifier) -> Names:
    """Names of the ECU behind an identifier, on a bus that has our ECU."""
    return OWN if identifier in (REQUEST, ANSWER, FUNCTIONAL, PERIODIC) else FOREIGN

"""Messages that a node sends side by side, encoded, protected and timed in one compiled call a tick.

The numbers of all of them are one vector, SI values in the order of the fields; NaN means not available. Bytes are
those of `dbc.codec`, message for message: the same arithmetic in the same order, raw values rounded half to even.
"""

from collections.abc import Iterable
from itertools import accumulate, compress, pairwise, repeat
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dbc import e2e
from dbc.codec import CodecError, Field
from dbc.compiled import CRC, PAYLOAD, compiled, writer
from dbc.contract import Message, MessageSpec, spec_of
from dbc.frame import Frame

Vector = NDArray[np.float64]
Octets = NDArray[np.uint8]
LIMIT = 1e300  # beyond is not a finite number to the codec
_COUNTERS = e2e.COUNTER_MODULUS
_new = tuple.__new__  # without the Python-made __new__ of a NamedTuple
_FRAMES = repeat(Frame)


_FIELD = np.dtype(
    [
        ("si_per_unit", "f8"), ("minimum", "f8"), ("maximum", "f8"), ("offset", "f8"), ("factor", "f8"),
        ("message", "i8"), ("shift", "i8"), ("mask", "i8"), ("has_sna", "i8"), ("sna", "i8"),
    ]
)  # fmt: skip
"""How the kernel sees a field; ``shift`` places its raw number in the payload read as one little-endian number."""
_SENDING = np.dtype(
    [("length", "i8"), ("protected", "i8"), ("crc_start", "i8"), ("cycle_ns", "i8"), ("slot", "i8"), ("counter", "i8")]
)
"""How the kernel sees a message, and what it remembers of it: slot of its cycle last sent in, next counter."""


@compiled
def _write(now_ns: int, values: Vector, fields: Any, messages: Any, due: Octets, payloads: Octets) -> int:
    """Write the payloads of all messages that are due, in ``due`` which these are; count up their counters.

    Returns
    -------
    -1, or the index of the first value that is neither a finite number nor has an SNA value.
    """
    words = np.zeros(len(messages), np.int64)
    for m in range(len(messages)):
        cycle_ns = messages[m]["cycle_ns"]
        due[m] = 1
        if cycle_ns != 0:
            slot = now_ns // cycle_ns
            due[m] = slot != messages[m]["slot"]
            messages[m]["slot"] = slot
    for k in range(len(values)):
        field, value = fields[k], values[k]
        m = field["message"]
        if due[m] == 0:
            continue
        if -LIMIT < value < LIMIT:
            value = min(max(value / field["si_per_unit"], field["minimum"]), field["maximum"])
            raw = np.int64(np.rint((value - field["offset"]) / field["factor"]))
        elif field["has_sna"] != 0:
            raw = field["sna"]
        else:
            return k
        words[m] |= (raw & field["mask"]) << field["shift"]
    for m in range(len(messages)):
        if due[m] == 0:
            continue
        message, first = messages[m], PAYLOAD * m
        length = message["length"]
        for i in range(length):
            payloads[first + i] = words[m] >> 8 * i & 0xFF
        if message["protected"] != 0:
            payloads[first + 1] |= message["counter"]
            crc = message["crc_start"]
            for i in range(1, length):
                crc = CRC[crc ^ payloads[first + i]]
            payloads[first] = crc
        message["counter"] = message["counter"] + 1 if message["counter"] + 1 < _COUNTERS else 0
    return -1


class Batch:
    """Messages that a node sends side by side, each at its cycle time, with its own alive counter.

    Parameters
    ----------
    types : the typed messages, in the order of their frames.

    Attributes
    ----------
    values : SI values of all fields, message after message, NaN where not available; shape (fields,). The node writes
        them before `frames`.
    write : writes all of them, each an argument.
    """

    def __init__(self, types: Iterable[type[Message]]) -> None:
        self._specs = [spec_of(kind) for kind in types]
        ends = list(accumulate((len(spec.fields) for spec in self._specs), initial=0))
        self._slices = {s.type: slice(*ends_of) for s, ends_of in zip(self._specs, pairwise(ends), strict=True)}
        self.values: Vector = np.full(ends[-1], np.nan)
        self.write = writer(self.values)
        self._fields = np.array([_row(m, s, f) for m, s in enumerate(self._specs) for f in s.fields], _FIELD)
        self._messages = np.array([_sending(spec) for spec in self._specs], _SENDING)
        self._due, self._payloads = bytearray(len(self._specs)), bytearray(PAYLOAD * len(self._specs))
        views = np.frombuffer(self._due, np.uint8), np.frombuffer(self._payloads, np.uint8)
        self._state = self.values, self._fields, self._messages, *views
        self._split = Struct("".join(f"{spec.length}s{PAYLOAD - spec.length}x" for spec in self._specs)).unpack
        self._buses, self._ids = tuple(spec.bus for spec in self._specs), tuple(spec.can_id for spec in self._specs)
        self._times, self._extended = (0,) * len(self._specs), (False,) * len(self._specs)

    def of(self, message_type: type[Message]) -> Vector:
        """Where the values of a message lie in `values`, to be written to; shape (fields,)."""
        return self.values[self._slices[message_type]]

    def due(self, message_type: type[Message], now_ns: int) -> bool:
        """Whether `frames` would send a message at ``now_ns``."""
        message = self._messages[list(self._slices).index(message_type)]
        return bool(message["cycle_ns"] == 0 or message["slot"] != now_ns // message["cycle_ns"])

    def frames(self, now_ns: int) -> list[Frame]:
        """Frames of the messages that are due, protected with their next counters."""
        odd = _write(now_ns, *self._state)
        if odd >= 0:
            raise CodecError(self._refusal(odd))
        payloads = self._split(self._payloads)
        parts = zip(self._buses, self._ids, payloads, self._times, self._extended, strict=False)
        return list(map(_new, _FRAMES, compress(parts, self._due) if 0 in self._due else parts))

    def _refusal(self, index: int) -> str:
        spec = self._specs[self._fields[index]["message"]]
        signal = spec.fields[index - self._slices[spec.type].start].signal
        return f"{spec.name}.{signal}: expected a finite number, got {self.values[index]}; it has no SNA value"


def _row(message: int, spec: MessageSpec, field: Field) -> tuple[float, ...]:
    """A field as `_FIELD`."""
    if not field.little_endian:
        raise CodecError(f"{spec.name}.{field.signal}: expected a little-endian signal; send it with a `Transmitter`")
    sna = (0, 0) if field.sna is None else (1, field.sna)
    scale = field.si_per_unit, field.minimum, field.maximum, field.offset, field.factor
    return *scale, message, field.start, (1 << field.length) - 1, *sna


def _sending(spec: MessageSpec) -> tuple[int, ...]:
    """A message as `_SENDING`, nothing sent yet."""
    protection = (0, 0) if spec.data_id is None else (1, e2e.start_value(spec.data_id))
    return spec.length, *protection, spec.cycle_ns, -1, 0

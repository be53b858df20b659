"""Frames of a tick, checked and decoded in one compiled call as long as each is the next of its sequence.

What is usual is done here: a whole payload with the right check value and the counter that follows the last one, a
cycle after it. For anything else the call stops at the frame, and `dbc.reception` judges it alone. Values are those of
`dbc.codec`, field for field; NaN where a signal is not available or out of range.
"""

from collections.abc import Iterable
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dbc import e2e
from dbc.codec import CodecError, Field, usable_raw
from dbc.compiled import CRC, PAYLOAD, compiled
from dbc.contract import MessageSpec

Vector = NDArray[np.float64]
Octets = NDArray[np.uint8]
_COUNTERS = e2e.COUNTER_MODULUS
JUDGED_ALONE = 255
"""Index in the place of a message's."""
_MEMORY = (
    "counter", "in_sequence", "usual_ns", "known_ns", "known", "fresh", "valid_in_row", "bad_in_row", "last_valid_ns",
    "received", "word", "well",
)  # fmt: skip
(
    COUNTER, IN_SEQUENCE, USUAL_NS, KNOWN_NS, KNOWN, FRESH, VALID_IN_ROW, BAD_IN_ROW, LAST_VALID_NS, RECEIVED, WORD,
    WELL,
) = range(len(_MEMORY))  # fmt: skip
"""Places of what is remembered of a message.

The word is its last usable payload as a little-endian number, known that of the last frame of its stream, usual the
time from one to the next; well is 1 where the last tick brought a usable frame and nothing odd.
"""
NO_COUNTER = e2e.COUNTER_MODULUS
"""Counter before the first frame; never on the wire."""
_FIXED = ("protected", "timed", "crc_start", "first", "last")  # the last two: of its values
_MESSAGE = np.dtype([(name, "i8") for name in (*_FIXED, *_MEMORY)])
_FIELD = np.dtype(
    [("factor", "f8"), ("offset", "f8"), ("si_per_unit", "f8")]
    + [(name, "i8") for name in ("shift", "mask", "sign", "least", "most", "has_sna", "sna")]
)  # ``sign``: highest bit of a signed raw number, else 0; ``least``, ``most``: of a usable one


@compiled
def _keep(now_ns: int, m: int, payload: Octets, messages: Any, fields: Any, values: Vector) -> None:
    """Decode a usable payload of message ``m`` and remember it."""
    message = messages[m]
    word = np.int64(0)
    for i in range(PAYLOAD):
        word |= np.int64(payload[i]) << 8 * i
    for k in range(message["first"], message["last"]):
        field = fields[k]
        raw = word >> field["shift"] & field["mask"]
        raw -= (raw & field["sign"]) << 1
        if raw < field["least"] or raw > field["most"] or (field["has_sna"] != 0 and raw == field["sna"]):
            values[k] = np.nan
        else:
            values[k] = (raw * field["factor"] + field["offset"]) * field["si_per_unit"]
    message["fresh"] = message["well"] = 1
    message["valid_in_row"] += 1
    message["bad_in_row"] = 0
    message["last_valid_ns"] = now_ns
    message["received"] = 1
    message["word"] = message["known"] = word
    message["known_ns"] = now_ns


@compiled
def _take(now_ns: int, begin: int, frames: Octets, messages: Any, fields: Any, values: Vector) -> int:
    """Take frames from ``begin`` on, up to the first that is not usual.

    Parameters
    ----------
    frames : index of the message of each frame, then all payloads.

    Returns
    -------
    index of that frame, or the number of frames.
    """
    if begin == 0:
        for m in range(len(messages)):
            messages[m]["fresh"] = messages[m]["well"] = 0
    number = len(frames) // (1 + PAYLOAD)
    for f in range(begin, number):
        m, first = frames[f], number + PAYLOAD * f
        if m >= len(messages):
            return f
        message, payload = messages[m], frames[first : first + PAYLOAD]
        if message["protected"] != 0:
            counter = payload[1] & 0x0F
            follows = message["counter"] + 1 if message["counter"] + 1 < _COUNTERS else 0
            if message["in_sequence"] == 0 or counter != follows:
                return f
            if message["timed"] != 0 and now_ns - message["known_ns"] != message["usual_ns"]:
                return f
            crc = message["crc_start"]
            for i in range(1, PAYLOAD):
                crc = CRC[crc ^ payload[i]]
            if crc != payload[0]:
                return f
            message["counter"] = counter
        _keep(now_ns, m, payload, messages, fields, values)
    return number


class Intake:
    """State and values of all messages that a node reads.

    Parameters
    ----------
    specs : the messages.

    Attributes
    ----------
    values : SI values of all fields, message after message, the last usable ones; NaN where there is none. Shape
        (fields,).
    memory : what is remembered of each message, by the places above.
    """

    def __init__(self, specs: Iterable[MessageSpec]) -> None:
        self.specs = list(specs)
        if len(self.specs) > JUDGED_ALONE:
            raise CodecError(f"a receiver of {len(self.specs)} messages: expected at most {JUDGED_ALONE}")
        ends = list(accumulate((len(spec.fields) for spec in self.specs), initial=0))
        self._slices = [slice(a, b) for a, b in pairwise(ends)]
        self.values: Vector = np.full(ends[-1], np.nan)
        self._fields = np.array([_row(spec, field) for spec in self.specs for field in spec.fields], _FIELD)
        rows = [_message(spec, where) for spec, where in zip(self.specs, self._slices, strict=True)]
        self._messages = np.array(rows, _MESSAGE)
        columns = self._messages.view(np.int64).reshape(len(rows), -1 if rows else 1)[:, len(_FIXED) :]
        self.memory = [memoryview(row) for row in columns]
        self._counters, self._well = self._messages["counter"], self._messages["well"]
        self._state = self._messages, self._fields, self.values

    @property
    def well(self) -> list[int]:
        """Of each message 1 where the last tick brought a usable frame and nothing odd."""
        well: list[int] = self._well.tolist()
        return well

    @property
    def counters(self) -> list[int]:
        """Last alive counter consumed of each message; `NO_COUNTER` where none was yet."""
        counters: list[int] = self._counters.tolist()
        return counters

    def of(self, index: int) -> Vector:
        """Where the values of a message lie in `values`."""
        return self.values[self._slices[index]]

    def take(self, now_ns: int, begin: int, frames: Octets) -> int:
        """Take frames from ``begin`` on while they are usual; index of the first that is not, or their number.

        Parameters
        ----------
        frames : index of the message of each, `JUDGED_ALONE` for one that is not usual; then their payloads, 8 bytes
            each.
        """
        unusual: int = _take(now_ns, begin, frames, *self._state)
        return unusual

    def keep(self, now_ns: int, index: int, payload: bytes) -> None:
        """Take a payload that was found to be usable."""
        _keep(now_ns, index, np.frombuffer(payload.ljust(PAYLOAD, b"\0"), np.uint8), *self._state)


def _message(spec: MessageSpec, where: slice) -> tuple[int, ...]:
    protection = (0, 0, 0)
    if spec.data_id is not None:
        protection = (1, int(spec.cycle_ns > 0), e2e.start_value(spec.data_id))
    return *protection, where.start, where.stop, NO_COUNTER, *[0] * (len(_MEMORY) - 1)


def _row(spec: MessageSpec, field: Field) -> tuple[float, ...]:
    """A field as `_FIELD`."""
    if not field.little_endian:
        raise CodecError(f"{spec.name}.{field.signal}: expected a little-endian signal; decode it by `spec_of`")
    least, most = usable_raw(field)
    if field.enum is not None:  # its members follow each other
        least, most = min(field.enum), max(field.enum)
        if len(field.enum) != most - least + 1:
            raise CodecError(f"{spec.name}.{field.signal}: expected choices without a gap, got {list(field.enum)}")
    sna = (0, 0) if field.sna is None else (1, field.sna)
    sign = 1 << (field.length - 1) if field.signed else 0
    scale = field.factor, field.offset, field.si_per_unit
    return *scale, field.start, (1 << field.length) - 1, sign, least, most, *sna

"""Protocol Buffers, as much as a table of numbers needs: a description of its fields, and rows of bytes.

Every number is a double of eight bytes, so that all rows of a message are equally long up to its texts, and numpy
makes them. Encoding and descriptor.proto: https://protobuf.dev/programming-guides/encoding/.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

FIXED64, LENGTH = 1, 2  # wire types
DOUBLE, BOOL, STRING, BYTES, UINT32 = 1, 8, 9, 12, 13  # FieldDescriptorProto.Type
_OPTIONAL = 1  # FieldDescriptorProto.Label
_FIRST_RESERVED, _LAST_RESERVED = 19_000, 19_999  # field numbers that the format keeps for itself


def varint(number: int) -> bytes:
    """A whole number from 0, seven bits a byte."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number])


def tag(number: int, wire: int) -> bytes:
    """What stands before a field's value."""
    return varint(number << 3 | wire)


def text(number: int, value: str | bytes) -> bytes:
    """A field of bytes, text or a message."""
    held = value.encode() if isinstance(value, str) else value
    return tag(number, LENGTH) + varint(len(held)) + held


def number_of(place: int) -> int:
    """Field number of the field at a place from 0; leaves the reserved ones out."""
    number = place + 1
    return number if number < _FIRST_RESERVED else number + _LAST_RESERVED - _FIRST_RESERVED + 1


def description(package: str, message: str, fields: Iterable[tuple[str, int]]) -> bytes:
    """FileDescriptorSet of one message, as MCAP wants it for a schema.

    Parameters
    ----------
    fields : name and type of each, in the order of `number_of`.
    """
    body = text(1, message)
    for place, (name, kind) in enumerate(fields):
        one = text(1, name) + tag(3, 0) + varint(number_of(place)) + tag(4, 0) + varint(_OPTIONAL)
        one += tag(5, 0) + varint(kind)
        body += text(2, one + text(10, name))  # 10: the name in JSON; two derived ones may be equal
    # proto2: a field may be absent, and its default is never meant
    file = text(1, f"{package}.{message}.proto") + text(2, package) + text(4, body) + text(12, "proto2")
    return text(1, file)


def rows_of(columns: Sequence[npt.NDArray[np.float64]], rows: int) -> npt.NDArray[np.uint8]:
    """Numbers as fields 1, 2, ... of messages, (rows, bytes)."""
    parts = []
    for place, column in enumerate(columns):
        head = np.frombuffer(tag(number_of(place), FIXED64), np.uint8)
        parts += [np.broadcast_to(head, (rows, len(head))), column.astype("<f8").view(np.uint8).reshape(rows, 8)]
    return np.concatenate(parts, axis=1) if parts else np.zeros((rows, 0), np.uint8)

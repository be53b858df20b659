"""Operations of FMI-LS-BUS 1.0 for classical CAN, as bytes and back.

Source: fmi-ls-bus, Network Abstraction, CAN (modelica.github.io/fmi-ls-bus), and its header ``fmi3LsBusCan.h``: packed,
little endian, each operation a header of code and total length (header included), four bytes each. Names in square
brackets are the standard's anchors.
"""

from collections.abc import Iterable, Iterator
from enum import IntEnum
from struct import Struct, error, unpack_from
from typing import NamedTuple

MIME_TYPE = 'application/org.fmi-standard.fmi-ls-bus.can; version="1.0.0"'
MOST_DATA = 8
_HEADER, _ID, _BYTE, _LENGTH = Struct("<II"), Struct("<I"), Struct("<B"), Struct("<H")
_TRANSMIT, _BUS_ERROR = Struct("<IBBH"), Struct("<IBBB")
_EXTENDED_ID, _STANDARD_ID = 1 << 29, 1 << 11


class Code(IntEnum):
    """What an operation is [table-operation-content-can]."""

    FORMAT_ERROR = 0x01
    CAN_TRANSMIT = 0x10
    CAN_FD_TRANSMIT = 0x11
    CAN_XL_TRANSMIT = 0x12
    CONFIRM = 0x20
    ARBITRATION_LOST = 0x30
    BUS_ERROR = 0x31
    CONFIGURATION = 0x40
    STATUS = 0x41
    WAKEUP = 0x42


class ErrorCode(IntEnum):
    """Kinds of bus errors [table-can-error-codes]."""

    BIT_ERROR = 1
    BIT_STUFFING_ERROR = 2
    FORM_ERROR = 3
    CRC_ERROR = 4
    ACK_ERROR = 5
    BROKEN_ERROR_FRAME = 6


class ErrorFlag(IntEnum):
    """Who saw a bus error first [table-can-bus-error-error-flag-kinds]."""

    PRIMARY = 1
    SECONDARY = 2


class Parameter(IntEnum):
    """What a configuration sets [table-can-configuration-kinds]."""

    CAN_BAUDRATE = 1
    CAN_FD_BAUDRATE = 2
    CAN_XL_BAUDRATE = 3
    ARBITRATION_LOST_BEHAVIOR = 4


BUFFER_AND_RETRANSMIT, DISCARD_AND_NOTIFY = 1, 2
"""Arbitration-lost behaviours [table-can-configuration-arbitration-lost-behavior-kinds]."""


class NodeStatus(IntEnum):
    """State of a node's error counters [table-can-status-values]."""

    ERROR_ACTIVE = 1
    ERROR_PASSIVE = 2
    BUS_OFF = 3


class FormatError(NamedTuple):
    """What came is no operation [low-cut-format-error-operation]; ``data`` is what came."""

    data: bytes


class Transmit(NamedTuple):
    """A classical CAN frame [low-cut-can-transmit-operation]."""

    can_id: int
    data: bytes
    extended: bool = False
    remote: bool = False


class Confirm(NamedTuple):
    """A frame was received by somebody [low-cut-can-confirm-operation]."""

    can_id: int


class ArbitrationLost(NamedTuple):
    """A frame lost against another and was discarded [low-cut-can-arbitration-lost-operation]."""

    can_id: int


class BusError(NamedTuple):
    """An error on the bus [low-cut-can-bus-error-operation]; ``sender``: of the receiving FMU's own frame."""

    can_id: int
    code: ErrorCode
    flag: ErrorFlag
    sender: bool


class Configuration(NamedTuple):
    """What a node asks of the bus simulation [low-cut-can-configuration-operation]; bit rates in bit/s."""

    parameter: Parameter
    value: int


class Status(NamedTuple):
    """State of the sending node [low-cut-can-status-operation]."""

    status: NodeStatus


class Wakeup(NamedTuple):
    """The bus wakes its nodes [low-cut-can-wake-up-operation]."""


class OtherFrame(NamedTuple):
    """A CAN FD or CAN XL frame, which a classical node does not take; ``content`` follows the header."""

    code: Code
    content: bytes


class Malformed(NamedTuple):
    """Bytes that are no operation, and why."""

    data: bytes
    why: str


Operation = FormatError | Transmit | Confirm | ArbitrationLost | BusError | Configuration | Status | Wakeup | OtherFrame


def encode(operation: Operation) -> bytes:
    """Bytes of one operation."""
    code, content = _content(operation)
    return _HEADER.pack(code, _HEADER.size + len(content)) + content


def encode_all(operations: Iterable[Operation]) -> bytes:
    """Bytes of operations one after the other, as a data variable holds them."""
    return b"".join(map(encode, operations))


def _content(operation: Operation) -> tuple[Code, bytes]:
    match operation:
        case Transmit(can_id, data, extended, remote):
            return Code.CAN_TRANSMIT, _TRANSMIT.pack(can_id, extended, remote, len(data)) + data
        case FormatError(data):
            return Code.FORMAT_ERROR, _LENGTH.pack(len(data)) + data
        case Confirm(can_id):
            return Code.CONFIRM, _ID.pack(can_id)
        case ArbitrationLost(can_id):
            return Code.ARBITRATION_LOST, _ID.pack(can_id)
        case BusError(can_id, code, flag, sender):
            return Code.BUS_ERROR, _BUS_ERROR.pack(can_id, code, flag, sender)
        case Configuration(parameter, value):
            kind = _BYTE if parameter is Parameter.ARBITRATION_LOST_BEHAVIOR else _ID
            return Code.CONFIGURATION, _BYTE.pack(parameter) + kind.pack(value)
        case Status(status):
            return Code.STATUS, _BYTE.pack(status)
        case OtherFrame(code, content):
            return code, content
        case _:
            return Code.WAKEUP, b""


def decode(data: bytes) -> Iterator[Operation | Malformed]:
    """Operations in a data variable; what is none is given as `Malformed`, behind a wrong length all of the rest."""
    at = 0
    while at < len(data):
        rest = data[at:]
        if len(rest) < _HEADER.size:
            yield Malformed(rest, f"{len(rest)} bytes, fewer than a header")
            return
        code, length = _HEADER.unpack_from(rest)
        if not _HEADER.size <= length <= len(rest):
            yield Malformed(rest, f"length {length}, expected {_HEADER.size} to {len(rest)}")
            return
        whole = rest[:length]
        try:
            yield _decoded(Code(code), whole[_HEADER.size :])
        except (ValueError, error) as wrong:
            yield Malformed(whole, str(wrong))
        at += length


def _decoded(code: Code, content: bytes) -> Operation:
    """One operation; ValueError or struct.error where the content is not of its kind."""
    match code:
        case Code.CAN_TRANSMIT:
            can_id, extended, remote, length = _TRANSMIT.unpack_from(content)
            data = content[_TRANSMIT.size :]
            if length != len(data) or length > MOST_DATA or extended > 1 or remote > 1:
                raise ValueError(f"data length {length} with {len(data)} bytes, ide {extended}, rtr {remote}")
            if can_id >= (_EXTENDED_ID if extended else _STANDARD_ID):
                raise ValueError(f"identifier {can_id:#x}: too large")
            return Transmit(can_id, data, bool(extended), bool(remote))
        case Code.FORMAT_ERROR:
            (length,) = _LENGTH.unpack_from(content)
            if length != len(content) - _LENGTH.size:
                raise ValueError(f"data length {length} with {len(content) - _LENGTH.size} bytes")
            return FormatError(content[_LENGTH.size :])
        case Code.CONFIRM:
            return Confirm(*_ID.unpack(content))
        case Code.ARBITRATION_LOST:
            return ArbitrationLost(*_ID.unpack(content))
        case Code.BUS_ERROR:
            can_id, kind, flag, sender = _BUS_ERROR.unpack(content)
            return BusError(can_id, ErrorCode(kind), ErrorFlag(flag), bool(sender))
        case Code.CONFIGURATION:
            parameter = Parameter(*unpack_from("<B", content))
            value = _BYTE if parameter is Parameter.ARBITRATION_LOST_BEHAVIOR else _ID
            return Configuration(parameter, *value.unpack(content[1:]))
        case Code.STATUS:
            return Status(NodeStatus(*_BYTE.unpack(content)))
        case Code.WAKEUP:
            if content:
                raise ValueError(f"{len(content)} bytes behind the header, expected none")
            return Wakeup()
        case _:
            return OtherFrame(code, content)

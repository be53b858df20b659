"""FMI-LS-BUS operations for CAN: bytes as the standard packs them, with its anchor beside each."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.fmu.ls_bus import (
    BUFFER_AND_RETRANSMIT,
    DISCARD_AND_NOTIFY,
    ArbitrationLost,
    BusError,
    Code,
    Configuration,
    Confirm,
    ErrorCode,
    ErrorFlag,
    FormatError,
    Malformed,
    NodeStatus,
    OtherFrame,
    Parameter,
    Status,
    Transmit,
    Wakeup,
    decode,
    encode,
    encode_all,
)

# anchors of fmi-ls-bus, chapter CAN; header: code and total length, 4 bytes each, little endian, `fmi3LsBus.h`
OPERATIONS = [
    # [low-cut-can-transmit-operation]: ID 4, Ide 1, Rtr 1, Data Length 2, Data n
    (Transmit(0x1, b"\x01\x02\x03\x04"), "10000000 14000000 01000000 00 00 0400 01020304"),
    (Transmit(0x0A8, bytes(range(8))), "10000000 18000000 a8000000 00 00 0800 0001020304050607"),
    (Transmit(0x18DAF110, b"\xff", extended=True), "10000000 11000000 10f1da18 01 00 0100 ff"),
    (Transmit(0x7FF, b"", remote=True), "10000000 10000000 ff070000 00 01 0000"),
    # [low-cut-can-confirm-operation]: ID 4
    (Confirm(0x130), "20000000 0c000000 30010000"),
    # [low-cut-format-error-operation]: Data Length 2, Data n
    (FormatError(b"\x99\x00"), "01000000 0c000000 0200 9900"),
    # [low-cut-can-arbitration-lost-operation]: ID 4
    (ArbitrationLost(0x138), "30000000 0c000000 38010000"),
    # [low-cut-can-bus-error-operation]: ID 4, Error Code 1 [table-can-error-codes], Error Flag 1
    # [table-can-bus-error-error-flag-kinds], Is Sender 1
    (BusError(0xA8, ErrorCode.CRC_ERROR, ErrorFlag.PRIMARY, True), "31000000 0f000000 a8000000 04 01 01"),
    (BusError(0xA8, ErrorCode.ACK_ERROR, ErrorFlag.SECONDARY, False), "31000000 0f000000 a8000000 05 02 00"),
    # [low-cut-can-configuration-operation]: Parameter Type 1 [table-can-configuration-kinds], baud rate 4
    (Configuration(Parameter.CAN_BAUDRATE, 500_000), "40000000 0d000000 01 20a10700"),
    # ... or behaviour 1 [table-can-configuration-arbitration-lost-behavior-kinds]
    (Configuration(Parameter.ARBITRATION_LOST_BEHAVIOR, BUFFER_AND_RETRANSMIT), "40000000 0a000000 04 01"),
    (Configuration(Parameter.ARBITRATION_LOST_BEHAVIOR, DISCARD_AND_NOTIFY), "40000000 0a000000 04 02"),
    # [low-cut-can-status-operation]: Status 1 [table-can-status-values]
    (Status(NodeStatus.ERROR_ACTIVE), "41000000 09000000 01"),
    (Status(NodeStatus.ERROR_PASSIVE), "41000000 09000000 02"),
    (Status(NodeStatus.BUS_OFF), "41000000 09000000 03"),
    # [low-cut-can-wake-up-operation]: the header alone
    (Wakeup(), "42000000 08000000"),
    # [low-cut-can-transmit-operation], CAN FD: ID 4, Ide 1, Brs 1, Esi 1, Data Length 2, Data n; not taken, but passed
    (
        OtherFrame(Code.CAN_FD_TRANSMIT, bytes.fromhex("0100000000010001 00aa")),
        "11000000 12000000 01000000 00 01 00 0100 aa",
    ),
]


@pytest.mark.parametrize(("operation", "text"), OPERATIONS, ids=lambda x: x if isinstance(x, str) else type(x).__name__)
def test_bytes_of_the_standard_both_ways(operation, text):
    data = bytes.fromhex(text)
    assert encode(operation) == data
    assert list(decode(data)) == [operation]


def test_operations_follow_each_other_in_one_buffer():
    operations = [operation for operation, _ in OPERATIONS]
    assert list(decode(encode_all(operations))) == operations


@pytest.mark.parametrize(
    ("text", "then"),
    [
        ("10000000", 0),  # less than a header
        ("10000000 07000000", 0),  # a length shorter than the header
        ("10000000 18000000 a8000000 00 00 0800 00", 0),  # cut off
        ("99000000 08000000", 1),  # no such code
        ("10000000 12000000 a8000000 00 00 0100 0000", 1),  # data length and total length do not agree
        ("10000000 19000000 a8000000 00 00 0900 000000000000000000", 1),  # nine bytes
        ("10000000 10000000 00080000 00 00 0000", 1),  # 12 bits in a standard identifier
        ("10000000 10000000 01000000 02 00 0000", 1),  # Ide neither true nor false
        ("31000000 0f000000 a8000000 07 01 01", 1),  # no such error code
        ("41000000 09000000 04", 1),  # no such status
        ("40000000 0a000000 01 01", 1),  # a baud rate of one byte
        ("42000000 09000000 00", 1),  # a wake-up with content
        ("20000000 0d000000 30010000 00", 1),  # a confirm with more
    ],
)
def test_what_is_no_operation_is_told_apart_and_what_follows_a_right_length_is_read(text, then):
    data = bytes.fromhex(text)
    first, *rest = decode(data + encode(Wakeup()) * then)
    assert isinstance(first, Malformed)
    assert first.data == data
    assert rest == [Wakeup()] * then


@given(st.binary(max_size=80))
def test_no_bytes_make_it_fall_over(data):
    found = list(decode(data))
    again = b"".join(one.data if isinstance(one, Malformed) else encode(one) for one in found)
    assert len(again) == len(data)

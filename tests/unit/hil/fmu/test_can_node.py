"""A node's CAN controller on an FMI-LS-BUS bus: queue, counters, states."""

import pytest

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.fmu.can_node import MOST_BYTES, CanNode
from hil.fmu.ls_bus import (
    BUFFER_AND_RETRANSMIT,
    ArbitrationLost,
    BusError,
    Code,
    Configuration,
    Confirm,
    ErrorCode,
    ErrorFlag,
    FormatError,
    NodeStatus,
    OtherFrame,
    Parameter,
    Status,
    Transmit,
    decode,
    encode,
    encode_all,
)

RATE = 500_000
DEMAND = Frame(BusName.VEHICLE, 0xA8, b"\x01" * 8)
SENDER_ERROR = encode(BusError(0xA8, ErrorCode.CRC_ERROR, ErrorFlag.SECONDARY, True))


def node(notified=True):
    one = CanNode(RATE, notified)
    assert list(decode(one.outgoing())) == [
        Configuration(Parameter.CAN_BAUDRATE, RATE),
        Configuration(Parameter.ARBITRATION_LOST_BEHAVIOR, BUFFER_AND_RETRANSMIT),
    ]
    return one


def said(one):
    return list(decode(one.outgoing()))


def states(inbox):
    return [item.state for item in inbox if isinstance(item, LinkEvent)]


def test_frames_of_the_vehicle_bus_go_out_once_and_those_of_the_bench_do_not():
    one = node()
    one.send([DEMAND, Frame(BusName.BENCH, 0x700, b"\0" * 8)])
    assert said(one) == [Transmit(0xA8, b"\x01" * 8)]
    assert said(one) == []


def test_frames_come_in_with_their_identifiers_and_remote_frames_do_not():
    one = node()
    came = [Transmit(0xA0, b"abc"), Transmit(0x18DAF110, b"", True), Transmit(0xA1, b"", remote=True)]
    one.receive(0, encode_all(came))
    assert one.inbox(0) == [
        Frame(BusName.VEHICLE, 0xA0, b"abc"),
        Frame(BusName.VEHICLE, 0x18DAF110, b"", 0, True),
    ]
    assert one.inbox(0) == []


def test_what_is_no_operation_is_answered_by_a_format_error():
    one = node()
    one.receive(0, bytes.fromhex("99000000 08000000") + encode(Transmit(0xA0, b"")))
    assert said(one) == [FormatError(bytes.fromhex("99000000 08000000"))]
    assert len(one.inbox(0)) == 1


def test_what_is_for_others_is_passed_over():
    one = node()
    for other in (Status(NodeStatus.BUS_OFF), OtherFrame(Code.CAN_FD_TRANSMIT, b"abc"), FormatError(b"")):
        one.receive(0, encode(other))
    assert (one.inbox(0), said(one), one.status) == ([], [], NodeStatus.ERROR_ACTIVE)


@pytest.mark.parametrize("reason", [SENDER_ERROR, encode(ArbitrationLost(0xA8))])
def test_a_frame_that_was_lost_is_sent_again_before_newer_ones_of_others(reason):
    one = node()
    one.send([DEMAND])
    one.outgoing()
    one.receive(0, reason)
    one.send([Frame(BusName.VEHICLE, 0xA9, b"")])
    assert said(one) == [Transmit(0xA8, b"\x01" * 8), Transmit(0xA9, b"")]


def test_a_newer_frame_takes_the_place_of_a_lost_one():
    one = node()
    one.send([DEMAND])
    one.outgoing()
    one.receive(0, SENDER_ERROR)
    one.send([Frame(BusName.VEHICLE, 0xA8, b"new")])
    assert said(one) == [Transmit(0xA8, b"new")]


@pytest.mark.parametrize("notified", [True, False])
def test_a_confirmed_frame_is_not_sent_again(notified):
    one = node(notified)
    one.send([DEMAND])
    one.outgoing()
    if notified:
        one.receive(0, encode(Confirm(0xA8)))
    one.receive(0, encode(ArbitrationLost(0xA8)))
    one.send([])
    assert said(one) == []


def test_sixteen_errors_make_a_sender_passive_and_a_confirmed_frame_active_again():
    one = node()
    one.receive(0, SENDER_ERROR * 15)
    assert (one.transmit_errors, one.status) == (120, NodeStatus.ERROR_ACTIVE)
    one.receive(0, SENDER_ERROR)
    assert said(one) == [Status(NodeStatus.ERROR_PASSIVE)]
    assert states(one.inbox(0))[-1] is LinkState.ERROR_PASSIVE
    one.receive(0, encode(Confirm(0xA8)))
    assert said(one) == [Status(NodeStatus.ERROR_ACTIVE)]


def test_thirty_two_errors_take_a_sender_off_the_bus_until_it_has_recovered():
    one = node()
    one.send([DEMAND])
    one.receive(10_000_000, SENDER_ERROR * 32)
    assert one.status is NodeStatus.BUS_OFF
    assert said(one) == [Status(NodeStatus.ERROR_PASSIVE), Status(NodeStatus.BUS_OFF)]  # nothing to transmit is left
    one.send([DEMAND])
    one.receive(10_000_000, encode(Transmit(0xA0, b"")))
    assert said(one) == []
    assert states(one.inbox(12_000_000))[-1] is LinkState.BUS_OFF
    assert one.inbox(12_800_000) == []  # 128 x 11 bits at 500 kbit/s are 2.816 ms
    assert states(one.inbox(12_816_000)) == [LinkState.RESTARTED]
    assert said(one) == [Status(NodeStatus.ERROR_ACTIVE)]
    assert (one.transmit_errors, one.receive_errors) == (0, 0)


def test_a_lone_sender_stays_passive():
    one = node()
    one.receive(0, encode(BusError(0xA8, ErrorCode.ACK_ERROR, ErrorFlag.PRIMARY, True)) * 100)
    assert (one.transmit_errors, one.status) == (128, NodeStatus.ERROR_PASSIVE)


def test_receivers_count_what_they_see_first_eight_times_as_much():
    one = node()
    one.receive(0, encode(BusError(0xA8, ErrorCode.FORM_ERROR, ErrorFlag.SECONDARY, False)) * 3)
    assert one.receive_errors == 3
    one.receive(0, encode(BusError(0xA8, ErrorCode.FORM_ERROR, ErrorFlag.PRIMARY, False)) * 16)
    assert (one.receive_errors, one.status) == (131, NodeStatus.ERROR_PASSIVE)
    one.receive(0, encode(Transmit(0xA0, b"")))
    assert (one.receive_errors, one.status) == (127, NodeStatus.ERROR_ACTIVE)


def test_more_than_the_variable_holds_follows_at_the_next_event():
    one = node()
    frames = [Frame(BusName.VEHICLE, k, b"\0" * 8) for k in range(400)]
    one.send(frames)
    first, second = one.outgoing(), one.outgoing()
    assert len(first) == MOST_BYTES // 24 * 24
    assert [op.can_id for op in decode(first + second)] == list(range(400))

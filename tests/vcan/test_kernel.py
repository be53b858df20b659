"""The lab itself: frames between sockets of the kernel, can-utils, compiled code and processes beside them."""

from __future__ import annotations

import re
import subprocess
import sys
import time

import can

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import open_bus


def _bus(channel: str, can_id: int) -> can.BusABC:
    filters = [{"can_id": can_id, "can_mask": 0x7FF, "extended": False}]
    return can.Bus(interface="socketcan", channel=channel, can_filters=filters)


def test_two_sockets_exchange_a_frame(vcan0: str) -> None:
    with _bus(vcan0, 0x6A0) as left, _bus(vcan0, 0x6A0) as right:
        left.send(can.Message(arbitration_id=0x6A0, data=b"\x01\x02\xff", is_extended_id=False))
        message = right.recv(5.0)
        assert message is not None
        assert (message.arbitration_id, bytes(message.data), message.is_extended_id) == (0x6A0, b"\x01\x02\xff", False)
        assert left.recv(0.0) is None  # a socket does not hear itself


def test_an_error_frame_written_to_vcan_reaches_those_who_ask(vcan0: str) -> None:
    with (
        can.Bus(interface="socketcan", channel=vcan0, can_filters=[]) as asking,
        can.Bus(interface="socketcan", channel=vcan0, ignore_rx_error_frames=True) as not_asking,
        can.Bus(interface="socketcan", channel=vcan0) as sender,
    ):
        data = bytes((0, 4, 0, 0, 0, 0, 0, 96))
        sender.send(can.Message(arbitration_id=0x204, data=data, is_error_frame=True, is_extended_id=False))
        sender.send(can.Message(arbitration_id=0x6A1, data=b"after", is_extended_id=False))
        first = asking.recv(5.0)
        while first is not None and not first.is_error_frame:  # another test's frame
            first = asking.recv(5.0)
        assert first is not None
        assert (first.arbitration_id, bytes(first.data)) == (0x204, data)
        heard = not_asking.recv(5.0)
        while heard is not None and heard.arbitration_id != 0x6A1:
            assert not heard.is_error_frame
            heard = not_asking.recv(5.0)
        assert heard is not None


def test_candump_sees_a_cansend(vcan0: str, can_utils: None) -> None:
    with subprocess.Popen(
        ["candump", "-L", "-n", "1", f"{vcan0},6A2:7FF"], stdout=subprocess.PIPE, text=True
    ) as candump:
        try:
            for _ in range(100):  # until candump, which does not tell when it listens, has heard one
                subprocess.run(["cansend", vcan0, "6A2#DEADBEEF"], check=True)
                time.sleep(0.05)
                if candump.poll() is not None:
                    break
        finally:
            candump.terminate()
        assert candump.stdout is not None
        line = candump.stdout.read()
    assert re.fullmatch(rf"\(\d+\.\d{{6}}\) {vcan0} 6A2#DEADBEEF\n", line)


ANSWER = """
import can, numba, numpy, sys

@numba.njit
def turned(data):
    answer = numpy.empty_like(data)
    for index in range(data.size):
        answer[index] = 255 - data[data.size - 1 - index]
    return answer

turned(numpy.zeros(8, numpy.uint8))
with can.Bus(interface="socketcan", channel=sys.argv[1],
             can_filters=[{"can_id": 0x6A3, "can_mask": 0x7FF, "extended": False}]) as bus:
    print("listening", flush=True)
    while (message := bus.recv(30.0)) is not None and message.dlc:
        answer = turned(numpy.array(message.data, numpy.uint8))
        bus.send(can.Message(arbitration_id=0x6A4, data=answer.tobytes(), is_extended_id=False))
"""


def test_another_process_answers_with_compiled_code_100_times_a_second(vcan0: str) -> None:
    with (
        subprocess.Popen([sys.executable, "-c", ANSWER, vcan0], stdout=subprocess.PIPE, text=True) as other,
        _bus(vcan0, 0x6A4) as bus,
    ):
        assert other.stdout is not None
        assert other.stdout.readline() == "listening\n"
        for tick in range(100):
            bus.send(can.Message(arbitration_id=0x6A3, data=[tick, 1, 2, 3, 4, 5, 6, 7], is_extended_id=False))
            answer = bus.recv(5.0)
            assert answer is not None
            assert list(answer.data) == [248, 249, 250, 251, 252, 253, 254, 255 - tick]
            time.sleep(0.01)
        bus.send(can.Message(arbitration_id=0x6A3, is_extended_id=False))
        assert other.wait(10.0) == 0


def test_a_lost_frame_is_told_although_nothing_follows(lab_vcan0: str) -> None:
    """More than a receive queue holds, then silence: what arrived and what was lost are all that was sent."""
    spec, sent = f"socketcan:{lab_vcan0}", 20_000
    with open_bus(spec, BusName.VEHICLE) as sender, open_bus(spec, BusName.VEHICLE) as receiver:
        for number in range(sent):
            sender.send([Frame(BusName.VEHICLE, 0x6A5, number.to_bytes(4, "big"))])
        assert sender.receive() == []
        received = receiver.receive()
        *frames, last = received
        assert isinstance(last, LinkEvent)
        assert (last.state, last.number) == (LinkState.RX_OVERFLOW, sent - len(frames))
        assert [int.from_bytes(frame.data, "big") for frame in frames if isinstance(frame, Frame)] == [
            *range(len(frames))
        ]
        assert receiver.receive() == []

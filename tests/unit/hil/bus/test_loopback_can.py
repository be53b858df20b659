import gc
import logging
import os
import socket
import subprocess
import sys
import threading
import time
import uuid
from pathlib import Path

import can
import pytest

from dbc.frame import BusName, Frame
from hil.bus import loopback_can, open_bus
from hil.bus.rendezvous import base_directory

VEHICLE = BusName.VEHICLE


@pytest.fixture
def name():
    return f"test-{uuid.uuid4().hex[:12]}"


def test_a_script_with_python_can_joins_a_running_bus(name):
    with open_bus(f"loopback:{name}", VEHICLE) as member, can.Bus(name, interface="brakebench") as script:
        member.send([Frame(VEHICLE, 0x123, b"abc"), Frame(VEHICLE, 0x1234567, b"", 0, True)])
        first, second = script.recv(20.0), script.recv(20.0)
        assert (first.arbitration_id, first.is_extended_id, bytes(first.data)) == (0x123, False, b"abc")
        assert (second.arbitration_id, second.is_extended_id, bytes(second.data)) == (0x1234567, True, b"")
        assert abs(first.timestamp - time.time()) < 60.0  # since 1970, as python-can's tools expect
        assert script.recv(0.0) is None
        script.send(can.Message(arbitration_id=0x7, is_extended_id=False, data=b"xy"))
        (frame,) = member.receive(20.0)
        assert frame[:3] == (VEHICLE, 0x7, b"xy")


def test_filters_of_python_can_work(name):
    filters = [{"can_id": 0x100, "can_mask": 0x7F0}]
    with (
        open_bus(f"loopback:{name}", VEHICLE) as member,
        can.Bus(name, interface="brakebench", can_filters=filters) as script,
    ):
        member.send([Frame(VEHICLE, can_id, b"") for can_id in (0x0FF, 0x100, 0x10F, 0x110)])
        assert [script.recv(20.0).arbitration_id for _ in range(2)] == [0x100, 0x10F]
        assert script.recv(0.0) is None


def test_stamps_keep_the_distances_of_sending(name):
    with open_bus(f"loopback:{name}", VEHICLE) as member, can.Bus(name, interface="brakebench") as script:
        with open_bus(f"loopback:{name}", VEHICLE) as witness:
            for _ in range(2):
                member.send([Frame(VEHICLE, 1, b"")])
            sent = [frame.time_ns for frame in witness.receive(20.0)]
        stamps = [script.recv(20.0).timestamp for _ in range(2)]
        assert stamps[1] - stamps[0] == pytest.approx((sent[1] - sent[0]) * 1e-9, abs=1e-6)


@pytest.mark.parametrize("kind", ["is_remote_frame", "is_error_frame", "is_fd"])
def test_only_classical_data_frames_are_sent(name, kind):
    with can.Bus(name, interface="brakebench") as script, pytest.raises(can.CanOperationError, match="classical data"):
        script.send(can.Message(arbitration_id=1, is_extended_id=False, **{kind: True}))


def test_a_bad_channel_name_is_python_cans_own_error():
    with pytest.raises(can.CanInitializationError, match="not a path"):
        can.Bus("../x", interface="brakebench")


def message(can_id, data=b""):
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=data)


def received(bus, number):
    return [(one.arbitration_id, one.is_rx) for one in (bus.recv(20.0) for _ in range(number))]


def test_own_messages_come_back_in_their_place(name):
    with (
        open_bus(f"loopback:{name}", VEHICLE) as member,
        can.Bus(name, interface="brakebench", receive_own_messages=True) as script,
        can.Bus(name, interface="brakebench") as other,
    ):
        for number in range(0, 30, 3):
            script.send(message(number, bytes([number])))
            member.send([Frame(VEHICLE, number + 1, b"")])
            other.send(message(number + 2))
        assert received(script, 30) == [(number, number % 3 != 0) for number in range(30)]
        assert received(other, 20) == [(number, True) for number in range(30) if number % 3 != 2]
        assert member.receive(20.0)[0].can_id == 0
        assert script.recv(0.0) is None
        assert other.recv(0.0) is None


def test_an_own_message_is_complete(name):
    with can.Bus(name, interface="brakebench", receive_own_messages=True) as script:
        sent = can.Message(arbitration_id=0x1234567, data=b"12345678")
        script.send(sent)
        back = script.recv(20.0)
        assert back.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)
        assert (back.is_rx, back.channel) == (False, name)
        assert abs(back.timestamp - time.time()) < 60.0


def test_an_own_message_wakes_a_receiver_that_waits(name):
    with can.Bus(name, interface="brakebench", receive_own_messages=True) as script:
        got = []
        thread = threading.Thread(target=lambda: got.extend(received(script, 100)))
        thread.start()
        for number in range(100):
            script.send(message(number))
        thread.join(20.0)
        assert got == [(number, False) for number in range(100)]


def test_an_answer_is_never_received_before_what_it_answers(name):
    with (
        can.Bus(name, interface="brakebench", receive_own_messages=True) as script,
        can.Bus(name, interface="brakebench") as other,
    ):

        def answer():
            for _ in range(200):
                other.send(message(other.recv(20.0).arbitration_id + 1))

        thread = threading.Thread(target=answer)
        thread.start()
        got = []
        for number in range(0, 400, 2):
            script.send(message(number))
            got += received(script, 2)
        thread.join(20.0)
        assert got == [(number, number % 2 == 1) for number in range(400)]


def test_filters_and_refused_messages_hold_for_own_ones(name):
    filters = [{"can_id": 0x100, "can_mask": 0x7FF}]
    with can.Bus(name, interface="brakebench", can_filters=filters, receive_own_messages=True) as script:
        script.send(message(0x200))
        script.send(message(0x100))
        bad = message(1)
        bad.arbitration_id = 0x800
        with pytest.raises(can.CanOperationError, match="11"):
            script.send(bad)
        assert received(script, 1) == [(0x100, False)]
        assert script.recv(0.0) is None


def test_own_messages_that_nobody_receives_are_bounded(name, monkeypatch, caplog):
    monkeypatch.setattr(loopback_can, "_MOST_OWN", 3)
    with can.Bus(name, interface="brakebench", receive_own_messages=True) as script:
        for number in range(5):
            script.send(message(number))
        with caplog.at_level(logging.WARNING, "can.brakebench"):
            assert received(script, 3) == [(number, False) for number in range(3)]
        assert "2 own frames lost" in caplog.text
        assert script.recv(0.0) is None


@pytest.mark.parametrize("options", [{"fd": True}, {"timing": can.BitTimingFd.from_sample_point(
    f_clock=80_000_000, nom_bitrate=500_000, nom_sample_point=80.0, data_bitrate=2_000_000, data_sample_point=80.0
)}], ids=["fd", "timing"])  # fmt: skip
def test_can_fd_is_refused_at_opening(name, options):
    with pytest.raises(can.CanInitializationError, match="classical frames of up to 8 bytes only; open it without fd"):
        can.Bus(name, interface="brakebench", **options)
    assert not (base_directory() / name).exists()
    can.Bus(name, interface="brakebench", fd=False, bitrate=500_000).shutdown()


def test_after_shutdown_every_call_is_python_cans_error(name):
    with open_bus(f"loopback:{name}", VEHICLE) as member:
        script = can.Bus(name, interface="brakebench", receive_own_messages=True)
        member.send([Frame(VEHICLE, 1, b"")] * 3)
        script.send(message(2))
        assert received(script, 1)
        script.shutdown()
        for timeout in (None, 0.0, 1.0):
            with pytest.raises(can.CanOperationError, match="shut down"):
                script.recv(timeout)
        with pytest.raises(can.CanOperationError, match="shut down"):
            script.send(message(1))
        script.shutdown()


def test_shutdown_ends_a_receiver_that_waits(name):
    script = can.Bus(name, interface="brakebench")
    ended = []

    def wait():
        try:
            script.recv(None)
        except can.CanOperationError as error:
            ended.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    time.sleep(0.05)
    script.shutdown()
    thread.join(20.0)
    assert not thread.is_alive()
    assert len(ended) == 1


def test_shutdown_ends_periodic_messages(name):
    with open_bus(f"loopback:{name}", VEHICLE) as member:
        script = can.Bus(name, interface="brakebench")
        script.send_periodic(message(0x55), 0.001)
        assert member.receive(20.0)[0].can_id == 0x55
        script.shutdown()
        member.receive()
        assert member.receive() == []


def test_no_descriptor_is_left_open(name):
    def descriptors():
        gc.collect()
        return len(list(Path("/proc/self/fd").iterdir()))

    can.Bus(name, interface="brakebench").shutdown()
    before = descriptors()
    for _ in range(20):
        can.Bus(name, interface="brakebench", receive_own_messages=True).shutdown()
    assert descriptors() <= before  # one fewer where something of another test was collected meanwhile


def test_dead_channels_are_not_listed(name):
    dead = base_directory() / f"{name}-dead"
    with open_bus(f"loopback:{name}", VEHICLE) as member:
        dead.mkdir(0o700)
        (dead / "lock").touch()
        (dead / "2-plain.sock").touch()  # no socket at all
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as left:
            directory = os.open(dead, os.O_PATH)  # a socket's path may have 107 bytes only
            left.bind(f"/proc/self/fd/{directory}/1-dead.sock")
            os.close(directory)
        found = {one["channel"] for one in can.detect_available_configs("brakebench")}
        assert name in found
        assert dead.name not in found
        assert len(list(dead.iterdir())) == 3  # looking changes nothing
        for path in dead.iterdir():
            path.unlink()
        dead.rmdir()
        assert member.receive() == []
        with can.Bus(name, interface="brakebench") as script:  # nor does it disturb those who are there
            script.send(message(3))
            assert [frame.can_id for frame in member.receive(20.0)] == [3]


def test_running_channels_are_found(name):
    with open_bus(f"loopback:{name}", VEHICLE):
        assert {"interface": "brakebench", "channel": name} in can.detect_available_configs("brakebench")


def test_the_logger_of_python_can_sees_every_frame(name, tmp_path):
    log = tmp_path / "seen.log"
    command = [sys.executable, "-m", "can.logger", "-i", "brakebench", "-c", name, "-f", str(log)]
    with (
        open_bus(f"loopback:{name}", VEHICLE) as member,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as logger,
    ):
        assert "Connected" in logger.stdout.readline()
        for number in range(500):
            member.send([Frame(VEHICLE, number, bytes([k])) for k in range(4)])
        deadline = time.monotonic() + 20.0
        member.send([Frame(VEHICLE, 0x7FF, b"")] * 2000)  # the logger writes to disk by the block
        while time.monotonic() < deadline and not (log.exists() and "7FF#" in log.read_text()):
            time.sleep(0.02)
        logger.terminate()
    seen = [line.split()[2] for line in log.read_text().splitlines() if "7FF#" not in line]
    assert seen == [f"{number:03X}#{k:02X}" for number in range(500) for k in range(4)]

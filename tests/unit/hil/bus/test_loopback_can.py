import subprocess
import sys
import time
import uuid

import can
import pytest

from dbc.frame import BusName, Frame
from hil.bus import open_bus

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

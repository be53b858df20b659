"""What every bus promises, whatever carries it."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from dbc.frame import BusName, Frame, LinkEvent, LinkState
from hil.bus import BusError, claim_channel, open_bus, wait
from hil.bus.channel import vcan_refusal
from hil.bus.rendezvous import base_directory

VEHICLE = BusName.VEHICLE
PATIENCE_S = 20.0

SPECS = ["loopback:{name}", "virtual:{name}", "socketcan:vcan0"]
BETWEEN_PROCESSES = ["loopback:{name}", "socketcan:vcan0"]


@pytest.fixture
def spec(request):
    if request.param.startswith("socketcan") and (refusal := vcan_refusal()):
        pytest.skip(f"{refusal}; .ci/vcan-lab runs this test on a real one")
    spec = request.param.format(name=f"test-{os.getpid()}-{abs(hash(request.node.name)) % 10**8}")
    give_up = time.monotonic() + 10 * PATIENCE_S
    while True:  # an interface is common to all tests that run at the same time: they take turns
        try:
            claim = claim_channel(spec)
            break
        except BusError:
            if time.monotonic() > give_up:
                raise
            time.sleep(0.05)
    with claim:
        yield spec


@pytest.fixture
def join(spec):
    """Open members of one bus; all are closed at the end."""
    members = []

    def join():
        members.append(open_bus(spec, VEHICLE))
        return members[-1]

    yield join
    for member in members:
        member.close()


def frames(numbers, can_id=0x123):
    return [Frame(VEHICLE, can_id, number.to_bytes(4, "big")) for number in numbers]


def numbers(received, can_id=0x123):
    return [int.from_bytes(f.data, "big") for f in received if isinstance(f, Frame) and f.can_id == can_id]


def lost(received, state=LinkState.RX_OVERFLOW):
    return sum(e.number for e in received if isinstance(e, LinkEvent) and e.state is state)


def receive_all(bus, count):
    """Receive until ``count`` frames have come or been reported lost."""
    received, give_up = [], time.monotonic() + PATIENCE_S
    while len(received) + lost(received) < count and time.monotonic() < give_up:
        received += bus.receive(0.2)
    return received


every_bus = pytest.mark.parametrize("spec", SPECS, indirect=True)
across = pytest.mark.parametrize("spec", BETWEEN_PROCESSES, indirect=True)
loopback = pytest.mark.parametrize("spec", ["loopback:{name}"], indirect=True)


@every_bus
def test_a_frame_arrives_as_it_was_sent(join):
    here, there = join(), join()
    sent = [
        Frame(VEHICLE, 0x000, b""),
        Frame(VEHICLE, 0x7FF, bytes(range(8))),
        Frame(VEHICLE, 0x7FF, b"\x00", 0, True),
        Frame(VEHICLE, 0x1FFFFFFF, b"\xff" * 8, 0, True),
    ]
    sent += [Frame(VEHICLE, 0x100 + n, bytes(n)) for n in range(9)]
    before_ns = time.monotonic_ns()
    here.send(sent)
    received = receive_all(there, len(sent))
    assert [f._replace(time_ns=0) for f in received] == sent
    tolerance_ns = 0 if "loopback" in there.name else 25_000_000  # stamped in the time of day, by whoever
    times_ns = [frame.time_ns for frame in received]
    assert times_ns == sorted(times_ns)
    assert before_ns - tolerance_ns <= times_ns[0]
    assert times_ns[-1] <= time.monotonic_ns()


@every_bus
def test_order_is_kept(join):
    here, there = join(), join()
    received, refused = [], 0
    for start in range(0, 3000, 30):
        here.send(frames(range(start, start + 30)))
        received += there.receive()
    while (news := there.receive(0.5)) or len(received) + refused < 3000:
        received += news
        told = here.receive()  # a driver's threads may be run over, where the machine is slow
        refused += lost(told, LinkState.TX_OVERFLOW)
        assert news or told, f"{len(received)} arrived, {refused} refused"
    arrived = numbers(received)
    assert arrived == sorted(arrived)
    assert len(arrived) + refused == 3000
    assert refused == 0 or here.name.startswith("virtual")


@every_bus
def test_nobody_receives_its_own(join):
    here, there = join(), join()
    here.send(frames([1, 2]))
    assert numbers(receive_all(there, 2)) == [1, 2]
    assert here.receive() == []


@every_bus
def test_all_others_receive(join):
    first, *others = [join() for _ in range(4)]
    first.send(frames(range(10)))
    others[0].send(frames(range(10, 20)))
    assert numbers(receive_all(others[0], 10)) == list(range(10))
    for other in others[1:]:
        assert sorted(numbers(receive_all(other, 20))) == list(range(20))
    assert numbers(receive_all(first, 10)) == list(range(10, 20))


@every_bus
def test_who_joins_late_receives_what_comes_later(join):
    here, there = join(), join()
    here.send(frames([1]))
    assert numbers(receive_all(there, 1)) == [1]
    late = join()
    here.send(frames([2]))
    assert numbers(receive_all(late, 1)) == [2]
    late.send(frames([3]))
    assert numbers(receive_all(there, 2)) == [2, 3]
    assert numbers(receive_all(here, 1)) == [3]


@every_bus
def test_leaving_disturbs_nobody_and_loses_nothing_sent_before(join):
    here, leaver, there = join(), join(), join()
    here.send(frames(range(5)))  # the leaver goes with these unread
    leaver.send(frames([5, 6]))
    leaver.close()
    leaver.close()
    here.send(frames([7]))
    assert sorted(numbers(receive_all(there, 8))) == list(range(8))
    assert numbers(receive_all(here, 2)) == [5, 6]
    assert leaver.fileno() == -1
    with pytest.raises(ValueError, match="closed"):
        leaver.receive()
    with pytest.raises(ValueError, match="closed"):
        leaver.send(frames([8]))


@every_bus
def test_receive_waits_for_the_first_and_no_longer(join):
    here, there = join(), join()
    assert there.receive() == []
    assert there.receive(0.01) == []
    asleep = threading.Event()

    def send_later():
        asleep.wait(PATIENCE_S)
        here.send(frames([1]))

    sender = threading.Thread(target=send_later)
    sender.start()
    asleep.set()
    received = there.receive(PATIENCE_S)
    sender.join()
    assert numbers(received) == [1]


@every_bus
@pytest.mark.parametrize(
    "frame",
    [
        Frame(BusName.BENCH, 1, b""),
        Frame(VEHICLE, 0x800, b""),
        Frame(VEHICLE, -1, b""),
        Frame(VEHICLE, 0x20000000, b"", 0, True),
        Frame(VEHICLE, 1, bytes(9)),
    ],
    ids=["other bus", "id of 12 bits", "negative id", "id of 30 bits", "9 bytes"],
)
def test_what_no_frame_can_be_is_refused(join, frame):
    here, there = join(), join()
    with pytest.raises(ValueError, match="expected bus vehicle"):
        here.send([frame])
    here.send(frames([1]))
    assert numbers(receive_all(there, 1)) == [1]


@every_bus
def test_a_burst_arrives_or_is_reported_lost(join):
    here, there = join(), join()
    for start in range(0, 20_000, 50):
        here.send(frames(range(start, start + 50)))
    received = receive_all(there, 1)
    here.send(frames([20_000]))  # a gap shows with what follows it
    refused, give_up = 0, time.monotonic() + PATIENCE_S
    while len(numbers(received)) + lost(received) + refused < 20_001 and time.monotonic() < give_up:
        received += there.receive(0.2)
        if here.name.startswith(
            "virtual"
        ):  # what a driver in threads does not take; on a loopback the receiver is told
            refused += lost(here.receive(), LinkState.TX_OVERFLOW)
    arrived = numbers(received)
    assert arrived == sorted(arrived)
    assert len(arrived) + lost(received) + refused == 20_001


@every_bus
def test_waiting_on_two_buses_at_once(join):
    here, there = join(), join()
    with open_bus(f"loopback:test-{os.getpid()}-other", BusName.BENCH) as other:
        wait([there, other], 0.01)
        here.send(frames([1]))
        received, give_up = [], time.monotonic() + PATIENCE_S
        while not received and time.monotonic() < give_up:
            wait([there, other], PATIENCE_S)
            received = there.receive()
        assert numbers(received) == [1]


@every_bus
def test_a_descriptor_is_readable_while_frames_wait(join):
    here, there = join(), join()
    here.send(frames([1]))
    assert select.select([there], [], [], PATIENCE_S)[0]
    receive_all(there, 1)
    assert not select.select([there], [], [], 0)[0]


# ---- between processes ----

MEMBER = """
import json, sys
from dbc.frame import BusName, Frame, LinkEvent
from hil.bus import open_bus
role, spec, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
with open_bus(spec, BusName.VEHICLE) as bus:
    print("ready", flush=True)
    if role == "flood":
        number = 0
        while True:
            bus.send([Frame(bus.bus, 0x7F0, (number + i).to_bytes(4, "big")) for i in range(5)])
            number += 5
            bus.receive(0.0005)
    numbers, lost, ended = [], 0, False
    while len(numbers) + lost < count and not ended:
        for item in bus.receive(20.0) or sys.exit("nothing came"):
            if isinstance(item, LinkEvent):
                lost += item.number
            elif item.can_id == 0x7FF:
                ended = True
            elif item.can_id == 0x123:
                numbers.append(int.from_bytes(item.data, "big"))
                if role == "echo":
                    bus.send([item._replace(can_id=0x124)])
    print(json.dumps({"numbers": numbers, "lost": lost}), flush=True)
"""


class Other:
    """A member in a process of its own."""

    def __init__(self, role, spec, count=0):
        command = [sys.executable, "-c", MEMBER, role, spec, str(count)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"

    def result(self):
        return json.loads(self.process.stdout.readline())

    def end(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


@pytest.fixture
def start(spec):
    others = []

    def start(role, count=0):
        others.append(Other(role, spec, count))
        return others[-1]

    yield start
    for other in others:
        other.end()


def channel_directory(bus):
    return base_directory() / bus.name.partition(":")[2]


@across
def test_two_processes_answer_each_other(join, start):
    echo, here = start("echo", 200), join()
    for number in range(200):
        here.send(frames([number]))
        assert numbers(receive_all(here, 1), 0x124) == [number]
    assert echo.result() == {"numbers": list(range(200)), "lost": 0}


@across
def test_three_processes_receive_the_same(join, start):
    others = [start("collect", 3000) for _ in range(3)]
    here = join()
    for start_number in range(0, 3000, 10):
        here.send(frames(range(start_number, start_number + 10)))
        time.sleep(0.0005)
    assert [other.result() for other in others] == [{"numbers": list(range(3000)), "lost": 0}] * 3


@across
def test_a_killed_member_is_missed_by_nobody(join, start):
    flood, here, there = start("flood"), join(), join()
    received = receive_all(there, 500)
    flood.process.kill()
    flood.process.wait()
    here.receive()
    here.send(frames(range(10)))
    while numbers(received)[-1:] != [9]:
        news = there.receive(PATIENCE_S)
        assert news
        received += news
    assert numbers(received) == list(range(10))
    flooded = numbers(received, 0x7F0)
    assert len(flooded) + lost(received) == flooded[-1] - flooded[0] + 1
    late = join()  # over the dead member's remains
    late.send(frames([11]))
    assert numbers(receive_all(there, 1)) == [11]
    assert late.receive() == []


@loopback
def test_a_stopped_member_loses_its_own_frames_only_and_learns_how_many(join, start):
    stopped, here, there = start("collect", 10**9), join(), join()
    here.send(frames([0]))
    stopped.process.send_signal(signal.SIGSTOP)
    received = receive_all(there, 1)
    for number in range(1, 20_000):
        here.send(frames([number]))
        if number % 100 == 0:
            received += there.receive()
    received += receive_all(there, 20_000 - len(received))
    assert numbers(received) == list(range(20_000))
    assert lost(received) == 0
    refused = here.receive()
    assert [e.state for e in refused] == [LinkState.TX_OVERFLOW]
    assert str(stopped.process.pid) in refused[0].detail
    stopped.process.send_signal(signal.SIGCONT)
    not_taken = refused[0].number
    while True:  # until all of them are counted
        here.send([Frame(VEHICLE, 0x7FF, b"")])
        if not (refused := here.receive()):
            break
        not_taken += refused[0].number
        time.sleep(0.01)
    result = stopped.result()
    assert result["lost"] == not_taken
    assert result["numbers"] == list(range(len(result["numbers"])))
    assert len(result["numbers"]) >= 100


@loopback
def test_a_loss_is_told_although_nothing_follows(join):
    here, there = join(), join()
    for first in range(0, 100_000, 50):
        here.send(frames(range(first, first + 50)))
    refused = sum(event.number for event in here.receive())
    assert refused > 0
    received = there.receive()
    assert lost(received) == 0  # its queue ends before the first gap
    assert here.receive() == []  # there is room again
    (event,) = there.receive()
    assert (event.state, event.number) == (LinkState.RX_OVERFLOW, refused)
    assert numbers(received) == list(range(100_000 - refused))
    here.receive()
    here.send(frames([100_000]))
    assert numbers(there.receive(PATIENCE_S)) == [100_000]


@loopback
def test_nothing_is_left_behind(join, start):
    other, here = start("flood"), join()
    receive_all(here, 5)
    directory = channel_directory(here)
    assert directory.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in directory.iterdir()} == {0o600}
    assert len(list(directory.glob("*.sock"))) == 2
    other.process.kill()
    other.process.wait()
    here.close()  # the last to leave cleans up after the killed one
    assert not directory.exists()


@loopback
def test_two_channels_side_by_side_know_nothing_of_each_other(join, spec):
    here, there = join(), join()
    with open_bus(spec + "-b", VEHICLE) as other_here, open_bus(spec + "-b", VEHICLE) as other_there:
        here.send(frames([1]))
        other_here.send(frames([2]))
        assert numbers(receive_all(there, 1)) == [1]
        assert numbers(receive_all(other_there, 1)) == [2]
        assert there.receive() == other_there.receive() == []


@loopback
def test_garbage_is_ignored_and_counted(join):
    here, there = join(), join()
    for path in channel_directory(here).glob("*.sock"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
            stranger.connect(str(path))
            for packet in (b"?", b"BBL1", bytes(24), b"BBL1" + bytes(20), os.urandom(40), bytes(5000)):
                stranger.send(packet)
    here.send(frames([1]))
    assert numbers(receive_all(there, 1)) == [1]
    here.receive()
    assert (here.garbage, there.garbage) == (6, 6)


def test_a_directory_of_somebody_else_is_refused(tmp_path, monkeypatch):
    (tmp_path / f"brakebench-{os.getuid()}").mkdir(mode=0o755)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(BusError, match=r"expected a directory of user \d+ with mode 0700"):
        open_bus("loopback:demo", VEHICLE)


def test_the_path_of_the_directory_may_be_longer_than_a_sockets(tmp_path, monkeypatch):
    deep = tmp_path / ("d" * 120)
    deep.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(deep))
    with open_bus("loopback:demo", VEHICLE) as here, open_bus("loopback:demo", VEHICLE) as there:
        here.send(frames([1]))
        assert numbers(receive_all(there, 1)) == [1]
    assert not list(deep.iterdir())

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from dbc.frame import BusName, Frame
from hil.bus import BusError, open_bus, rendezvous
from hil.bus.rendezvous import base_directory

VEHICLE = BusName.VEHICLE
MEMBERS = 8


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / f"brakebench-{os.getuid()}"


def in_threads(work):
    """Run ``work(0..MEMBERS-1)`` at once; hand on the first error."""
    errors = []

    def guarded(number):
        try:
            work(number)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded, args=(number,)) for number in range(MEMBERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def test_members_that_join_at_once_all_meet(place):
    start, joined, sent = (threading.Barrier(MEMBERS) for _ in range(3))
    met = {}

    def member(number):
        start.wait()
        with open_bus("loopback:demo", VEHICLE) as bus:
            joined.wait()
            bus.send([Frame(VEHICLE, number, b"")])
            sent.wait()
            received = []
            while len(received) < MEMBERS - 1:
                news = bus.receive(20.0)
                assert news
                received += news
            met[number] = {frame.can_id for frame in received}
            sent.wait()

    in_threads(member)
    assert met == {number: set(range(MEMBERS)) - {number} for number in range(MEMBERS)}
    assert not place.exists()


def test_joining_and_leaving_at_once_leaves_nothing(place):
    def member(number):
        for turn in range(20):
            with open_bus(f"loopback:demo{(number + turn) % 2}", VEHICLE) as bus:
                bus.send([Frame(VEHICLE, number, b"")])
                bus.receive()

    in_threads(member)
    assert not place.exists()


def test_a_dead_members_socket_is_removed_by_the_next(place):
    program = "from dbc.frame import BusName; from hil.bus import open_bus; import os, signal\n"
    program += "open_bus('loopback:demo', BusName.VEHICLE); os.kill(os.getpid(), signal.SIGKILL)"
    dead = subprocess.run([sys.executable, "-c", program], check=False)
    assert dead.returncode == -signal.SIGKILL
    assert len(list((place / "demo").glob("*.sock"))) == 1
    with open_bus("loopback:demo", VEHICLE):
        (own,) = (place / "demo").glob("*.sock")
        assert own.name.startswith(f"{os.getpid()}-")
    assert not place.exists()


def test_a_directory_removed_under_a_member_stops_neither_it_nor_a_new_one(place):
    here, there = open_bus("loopback:demo", VEHICLE), open_bus("loopback:demo", VEHICLE)
    for path in (place / "demo").iterdir():
        path.unlink()
    (place / "demo").rmdir()
    here.send([Frame(VEHICLE, 1, b"")])
    assert [frame.can_id for frame in there.receive(20.0)] == [1]
    open_bus("loopback:demo", VEHICLE).close()
    here.close()
    there.close()
    assert not place.exists()


def test_a_lock_that_is_never_released_is_an_error_not_a_hang(place, monkeypatch):
    monkeypatch.setattr(rendezvous, "_PATIENCE_NS", 30_000_000)
    monkeypatch.setattr(rendezvous, "_LEAVING_NS", 30_000_000)
    with open_bus("loopback:demo", VEHICLE) as bus:
        lock = os.open(place / "demo" / "lock", os.O_RDWR)
        rendezvous.fcntl.flock(lock, rendezvous.fcntl.LOCK_EX)
        with pytest.raises(BusError, match=r"locked for 0\.03 s by another member"):
            open_bus("loopback:demo", VEHICLE)
        open_bus("loopback:other", VEHICLE).close()
        bus.close()  # a member that leaves waits no longer than it said
        os.close(lock)


def test_a_link_in_place_of_the_directory_is_refused(place, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    place.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BusError, match="expected a directory of user"):
        open_bus("loopback:demo", VEHICLE)


@pytest.mark.parametrize("wrong", ["", "demo"])
def test_a_file_in_place_of_a_directory_is_refused(place, wrong):
    path = place / wrong
    path.parent.mkdir(mode=0o700, exist_ok=True)
    path.write_text("")
    with pytest.raises(BusError, match=r"expected a directory of user.*got -rw"):
        open_bus("loopback:demo", VEHICLE)


def test_a_directory_that_cannot_be_made_is_refused(place, monkeypatch):
    def refuse(path, mode):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(rendezvous.Path, "mkdir", refuse)
    with pytest.raises(BusError, match=r"cannot use .*demo for a loopback channel.*Permission denied"):
        open_bus("loopback:demo", VEHICLE)


def test_without_a_runtime_directory_the_temporary_one_serves(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "missing"))
    monkeypatch.setattr(rendezvous.tempfile, "gettempdir", lambda: str(tmp_path))
    assert base_directory() == tmp_path / f"brakebench-{os.getuid()}"


def test_a_member_that_floods_does_not_hold_the_reader_up(place):
    with open_bus("loopback:demo", VEHICLE) as bus:
        (path,) = (place / "demo").glob("*.sock")
        stop = threading.Event()
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as babbler:
            directory = os.open(path.parent, os.O_PATH)  # a socket's path may have 107 bytes only
            babbler.connect(f"/proc/self/fd/{directory}/{path.name}")
            os.close(directory)

            def babble():
                while not stop.is_set():
                    babbler.send(b"nonsense")

            thread = threading.Thread(target=babble)
            thread.start()
            give_up = time.monotonic() + 20.0
            while bus.garbage < 1000 and time.monotonic() < give_up:
                assert bus.receive() == []
            stop.set()
            bus.receive()
            thread.join(0.01)
            while thread.is_alive():
                bus.receive()
                thread.join(0.01)
        assert bus.garbage >= 1000

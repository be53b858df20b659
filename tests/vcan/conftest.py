"""The kernel's CAN interfaces for the tests, or the reason why there are none here."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from candump import Candump
from lab import Lab
from slcan_device import SlcanDevice
from started import COMMAND, Started

TIOCSETD = 0x5423  # asm-generic/ioctls.h
SIOCGIFNAME, SIOCGIFFLAGS, SIOCSIFFLAGS = 0x8910, 0x8913, 0x8914  # linux/sockios.h
IFF_UP = 1  # linux/if.h
N_TTY, N_SLCAN = 0, 17  # linux/tty.h
LAB = os.environ.get("VCAN_LAB")  # set by .ci/vcan-lab: "kernel" or "uml"

_lab = Lab("lab", LAB, "SocketCAN", ("can", "vcan", "slcan"), "the kernel's SocketCAN")
pytest_report_header, pytest_terminal_summary = _lab.report_header, _lab.terminal_summary
pytest_sessionstart, pytest_sessionfinish = _lab.sessionstart, _lab.sessionfinish


@pytest.fixture(scope="session")
def figure() -> Callable[[str], None]:
    """Take a line for the end of the test run's output."""
    return _lab.figures.append


def _absent(reason: str, required: bool) -> NoReturn:
    """Skip; but where the lab promised the interface, its absence is a failure."""
    if required:
        pytest.fail(f"{reason}, although .ci/vcan-lab should have provided it")
    pytest.skip(f"{reason}; run under .ci/vcan-lab")


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout


@pytest.fixture
def vcan0() -> str:
    """Name of a virtual CAN interface that is up. Other tests may use it at the same time: choose ids of your own."""
    if not hasattr(socket, "AF_CAN") or not Path("/sys/class/net/vcan0").exists():
        _absent("no interface vcan0", required=LAB is not None)
    if Path("/sys/class/net/vcan0/operstate").read_text().strip() == "down":
        _absent("vcan0 is down", required=LAB is not None)
    return "vcan0"


@pytest.fixture(scope="module")
def lab_vcan0(request: pytest.FixtureRequest) -> str:
    """Name of a vcan that nobody else uses, with can-utils beside it: the lab's."""
    if LAB is None:
        pytest.skip("needs a vcan0 that nobody else uses; run under .ci/vcan-lab")
    if not Path("/sys/class/net/vcan0").exists():
        _absent("no interface vcan0", required=True)
    request.getfixturevalue("can_utils")
    return "vcan0"


@pytest.fixture(scope="session")
def can_utils() -> None:
    """The programs of can-utils are installed."""
    for program in ("candump", "cansend", "slcand"):
        if shutil.which(program) is None:
            _absent(f"no `{program}` command (can-utils)", required=LAB is not None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Directory of a module's runs."""
    return tmp_path_factory.mktemp(request.module.__name__)


@pytest.fixture(scope="module")
def begin(folder: Path) -> Iterator[Callable[..., Started]]:
    """Start a command and go on; whatever still runs at the end is killed."""
    started: list[Started] = []

    def begin(*arguments: str) -> Started:
        words = folder / f"words-{len(started)}.txt"
        with words.open("w") as errors:
            process = subprocess.Popen(
                [*COMMAND, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=errors, text=True
            )
        started.append(Started(process, words))
        return started[-1]

    yield begin
    for process, _ in started:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=30)


@pytest.fixture(scope="module")
def candump(folder: Path, can_utils: None) -> Iterator[Callable[[str], Candump]]:
    """Start candump on an interface."""
    started: list[Candump] = []

    def begin(interface: str) -> Candump:
        started.append(Candump(interface, folder / f"candump-{len(started)}"))
        return started[-1]

    yield begin
    for one in started:
        one.kill()


class SlcanInterface:
    """An interface of the kernel's slcan driver with our device at its other end.

    Attributes
    ----------
    device : the adapter in software.
    name : name of the interface, ``can0`` or the next that is free.
    """

    def __init__(self, device: SlcanDevice) -> None:
        self.device = device
        fcntl.ioctl(device.port_fd, TIOCSETD, struct.pack("i", N_SLCAN))
        self.name = fcntl.ioctl(device.port_fd, SIOCGIFNAME, bytes(40)).split(b"\0")[0].decode()

    def up(self, *settings: str) -> None:
        """Set 500 kbit/s (and more, such as ``"listen-only", "on"``) and bring the interface up."""
        _ip("link", "set", self.name, "up", "type", "can", "bitrate", "500000", *settings)
        self.device.wait_open()

    def set(self, *settings: str) -> None:
        """Change a setting of the link, such as ``"txqueuelen", "100"``."""
        _ip("link", "set", self.name, *settings)

    def down(self) -> None:
        """Take the interface down, as ``ip link set down`` does (a process less: they are slow in the lab)."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
            request = struct.pack("16sh22x", self.name.encode(), 0)
            (flags,) = struct.unpack_from("h", fcntl.ioctl(any_socket, SIOCGIFFLAGS, request), 16)
            fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh22x", self.name.encode(), flags & ~IFF_UP))
        self.device.wait_open(False)

    def details(self) -> dict[str, Any]:
        """What ``ip`` knows about the interface."""
        link: dict[str, Any] = json.loads(_ip("-details", "-statistics", "-json", "link", "show", self.name))[0]
        return link

    def state(self) -> str:
        """State of the controller: ``ERROR-ACTIVE``, ``BUS-OFF``, ..."""
        return str(self.details()["linkinfo"]["info_data"]["state"])

    def unplug(self) -> None:
        """Take the driver off the port: the interface vanishes under whoever uses it."""
        fcntl.ioctl(self.device.port_fd, TIOCSETD, struct.pack("i", N_TTY))


@pytest.fixture
def slcan_device() -> Iterator[SlcanDevice]:
    """An adapter without a driver, where the kernel's slcan could be attached."""
    if shutil.which("ip") is None:
        _absent("no `ip` command (iproute2)", required=LAB == "uml")
    if os.geteuid() != 0:
        _absent("attaching slcan needs root", required=LAB == "uml")
    with SlcanDevice() as device:
        try:
            fcntl.ioctl(device.port_fd, TIOCSETD, struct.pack("i", N_SLCAN))
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.EPERM):
                raise
            _absent(f"the kernel has no slcan line discipline ({error.strerror})", required=LAB == "uml")
        fcntl.ioctl(device.port_fd, TIOCSETD, struct.pack("i", N_TTY))
        yield device


@pytest.fixture
def slcan(slcan_device: SlcanDevice) -> Iterator[SlcanInterface]:
    """An interface of the slcan driver, up at 500 kbit/s."""
    interface = SlcanInterface(slcan_device)
    interface.up()
    yield interface
    if Path("/sys/class/net", interface.name).exists():
        interface.down()  # unplugged while up, the driver would wait a second for the adapter's answer
        interface.unplug()

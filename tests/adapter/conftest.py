"""Two adapters on one bus with a real driver, or the reason why there are none here."""

from __future__ import annotations

import json
import os
import shutil
import struct
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from candump import Candump
from lab import Lab
from started import COMMAND, Started

from hil.cli.main import build_parser

LAB = os.environ.get("ADAPTER_LAB")  # set by .ci/adapter-lab: "qemu"
BIT_RATE = "500000"
PCI_COMMAND, PCI_COMMAND_INTX_DISABLE = 0x04, 0x400  # linux/pci_regs.h

_lab = Lab("adapter", LAB, "adapters", ("can", "kvaser", "sja1000"), "the emulated adapters")
pytest_report_header, pytest_terminal_summary = _lab.report_header, _lab.terminal_summary
pytest_sessionstart, pytest_sessionfinish = _lab.sessionstart, _lab.sessionfinish


@pytest.fixture(scope="session")
def figure() -> Callable[[str], None]:
    """Take a line for the end of the test run's output."""
    return _lab.figures.append


class Adapter:
    """An adapter with its driver.

    Attributes
    ----------
    name, spec : its interface, and that as a bus.
    slot : its PCI address.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.spec = f"socketcan:{name}"
        device = Path("/sys/class/net", name, "device").resolve()
        self.slot = device.name
        self.driver = (device / "driver").resolve().name
        self._device = device

    def up(self, *settings: str) -> None:
        """Set the bit rate (and more, such as ``"restart-ms", "100"``) and bring the interface up."""
        _ip("link", "set", self.name, "up", "type", "can", "bitrate", BIT_RATE, *settings)

    def down(self) -> None:
        """Take the interface down."""
        _ip("link", "set", self.name, "down")

    def set(self, *settings: str) -> None:
        """Change a setting of the link, such as ``"txqueuelen", "2"``."""
        _ip("link", "set", self.name, *settings)

    def details(self) -> dict[str, Any]:
        """What ``ip`` knows about the interface."""
        link: dict[str, Any] = json.loads(_ip("-details", "-statistics", "-json", "link", "show", self.name))[0]
        return link

    def unbind(self) -> None:
        """Take the driver off the card, as when it is unplugged: the interface vanishes under whoever uses it."""
        Path("/sys/bus/pci/drivers", self.driver, "unbind").write_text(self.slot)

    def bind(self) -> None:
        """Give the card its driver back; the interface is down."""
        Path("/sys/bus/pci/drivers", self.driver, "bind").write_text(self.slot)

    def interrupts(self, on: bool) -> None:
        """Let the card's interrupts through, or not: without them no transmission ends, as if nobody acknowledged."""
        with (self._device / "config").open("r+b", buffering=0) as config:
            config.seek(PCI_COMMAND)
            (command,) = struct.unpack("<H", config.read(2))
            command = command & ~PCI_COMMAND_INTX_DISABLE if on else command | PCI_COMMAND_INTX_DISABLE
            config.seek(PCI_COMMAND)
            config.write(struct.pack("<H", command))


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="session")
def adapters() -> tuple[Adapter, Adapter]:
    """The adapters of car and controller, ``can0`` and ``can1``, up on one bus."""
    if LAB is None:
        pytest.skip("needs two adapters whose driver may be taken away; run under .ci/adapter-lab")
    for program in ("ip", "candump", "cansend"):
        if shutil.which(program) is None:
            pytest.fail(f"no `{program}` command, although .ci/install-lab adapter should have installed it")
    for name in ("can0", "can1"):
        if not Path("/sys/class/net", name).exists():
            pytest.fail(f"no interface {name}, although .ci/adapter-lab should have provided it")
    return Adapter("can0"), Adapter("can1")


@pytest.fixture
def cards(adapters: tuple[Adapter, Adapter]) -> Iterator[tuple[Adapter, Adapter]]:
    """Both adapters; at the end they are as they were, whatever a test did."""
    yield adapters
    for adapter in adapters:
        if not Path("/sys/class/net", adapter.name).exists():
            adapter.bind()
        adapter.interrupts(True)
        adapter.down()
        adapter.set("txqueuelen", "10")
        adapter.up()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Directory of a module's runs."""
    return tmp_path_factory.mktemp(request.module.__name__.rpartition(".")[2])


@pytest.fixture(scope="module")
def begin(folder: Path) -> Iterator[Callable[..., Started]]:
    """Start a command and go on; whatever still runs at the end is killed."""
    started: list[Started] = []

    def begin(name: str, *arguments: str) -> Started:
        words = folder / f"words-{len(started)}.txt"
        command = [*COMMAND, name, *transmit(name), *arguments]
        with words.open("w") as errors:
            process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=errors, text=True)
        started.append(Started(process, words))
        return started[-1]

    yield begin
    for process, _ in started:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=30)


def transmit(command: str) -> list[str]:
    """The option by which a command may send on hardware, where it has one."""
    (commands,) = (action.choices for action in build_parser([command])._actions if isinstance(action.choices, dict))
    return ["--transmit"] if "--transmit" in commands[command].format_help() else []


@pytest.fixture(scope="module")
def candump(folder: Path) -> Iterator[Callable[[str], Candump]]:
    """Start candump on an interface."""
    started: list[Candump] = []

    def begin(interface: str) -> Candump:
        started.append(Candump(interface, folder / f"candump-{len(started)}"))
        return started[-1]

    yield begin
    for one in started:
        one.kill()

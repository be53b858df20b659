#!/usr/bin/env python3
"""A serial-line CAN adapter in software: what is at the other end of the kernel's slcan driver.

It speaks the ASCII protocol of Lawicel's CAN232 ("CANUSB manual", www.canusb.com) over a pseudo-terminal, with the
state and error lines the Linux driver adds to it (drivers/net/can/slcan/slcan-core.c). Run as a script it prints the
name of its port, sends every line it reads from standard input, and prints what it receives.
"""

from __future__ import annotations

import contextlib
import os
import select
import sys
import threading
import tty
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import NamedTuple

BIT_RATES_BPS = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)  # S0 to S8

# s<state><rx counter><tx counter>, counters as three decimal digits
ERROR_ACTIVE = "sa000000"
ERROR_WARNING = "sw096000"
ERROR_PASSIVE = "sp000130"
BUS_OFF = "sb000256"
# e<number of errors><one letter each>
NO_ACK = "e1a"


class SlcanFrame(NamedTuple):
    """A frame on the adapter's CAN side."""

    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    dlc: int | None = None  # length asked for by a remote frame

    def line(self) -> str:
        """Spell the frame in the protocol: ``t1232AABB`` is identifier 0x123 with two bytes."""
        letter = "tTrR"[self.extended + 2 * self.remote]
        identifier = f"{self.can_id:08X}" if self.extended else f"{self.can_id:03X}"
        return f"{letter}{identifier}{len(self.data) if self.dlc is None else self.dlc:X}{self.data.hex().upper()}"

    @classmethod
    def parse(cls, line: str) -> SlcanFrame:
        """Read such a line; ValueError where it is none."""
        extended, remote = line[0].isupper(), line[0] in "rR"
        digits = 8 if extended else 3
        dlc = int(line[1 + digits], 16)
        data = bytes.fromhex(line[2 + digits :])
        if line[0] not in "tTrR" or dlc > 8 or len(data) != (0 if remote else dlc):
            raise ValueError(f"not a frame of the serial-line protocol: {line!r}")
        return cls(int(line[1 : 1 + digits], 16), data, extended, remote, dlc if remote else None)


class SlcanDevice:
    """The adapter, served by a thread of its own.

    Attributes
    ----------
    port : path of the serial port to attach a driver to.
    port_fd : the port, kept open, so that nothing is hung up between one driver and the next.
    is_open, listen_only, bit_rate_bps : what the driver commanded (None: no bit rate commanded).
    bus_off : it said so; it sends nothing then until it is opened again or says another state.
    commands : every line received, in order.
    """

    def __init__(self) -> None:
        self._line_side, self.port_fd = os.openpty()
        tty.setraw(self.port_fd)
        self.port = os.ttyname(self.port_fd)
        self.is_open = False
        self.listen_only = False
        self.bit_rate_bps: int | None = None
        self.bus_off = False
        self.commands: deque[str] = deque()
        self._received: deque[SlcanFrame] = deque()
        self._news = threading.Condition()
        self._taking = threading.Lock()
        self._stop, self._stopper = os.pipe()
        self._thread = threading.Thread(target=self._serve, name="slcan-device", daemon=True)
        self._thread.start()

    def __enter__(self) -> SlcanDevice:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Unplug the adapter."""
        os.write(self._stopper, b"x")
        self._thread.join()
        for fd in (self._line_side, self.port_fd, self._stop, self._stopper):
            os.close(fd)

    @contextlib.contextmanager
    def punctual(self) -> Iterator[None]:
        """Never wait for a processor meanwhile, as hardware does not; needs root. For the calling thread too."""
        threads = (threading.get_native_id(), self._thread.native_id or 0)
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
        try:
            yield
        finally:
            for thread in threads:
                os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))

    def send(self, frame: SlcanFrame) -> None:
        """Another node on the bus sends a frame."""
        self.send_line(frame.line())

    def send_line(self, line: str) -> None:
        """Say a line to the driver as it stands: ``ERROR_WARNING``, ``NO_ACK``, ..."""
        if line[:1] == "s":
            self.bus_off = line[1:2] == "b"
        os.write(self._line_side, line.encode("ascii") + b"\r")

    def receive(self, timeout_s: float = 5.0) -> SlcanFrame:
        """Take the next frame the driver sent to the bus; TimeoutError where there is none."""
        with self._news:
            if not self._news.wait_for(lambda: self._received, timeout_s):
                raise TimeoutError(f"the driver sent no frame within {timeout_s} s")
            return self._received.popleft()

    def wait_open(self, is_open: bool = True, timeout_s: float = 5.0) -> None:
        """Wait until the driver has opened (or closed) the channel; TimeoutError where it did not."""
        with self._news:
            if not self._news.wait_for(lambda: self.is_open == is_open, timeout_s):
                raise TimeoutError(f"channel not {'opened' if is_open else 'closed'} within {timeout_s} s")

    @contextlib.contextmanager
    def stalled(self) -> Iterator[None]:
        """Take nothing from the driver meanwhile, as an adapter does whose bus is full."""
        with self._taking:
            yield

    def _serve(self) -> None:
        rest = b""
        while True:
            ready, _, _ = select.select([self._line_side, self._stop], [], [])
            if self._stop in ready:
                return
            with self._taking:
                *lines, rest = (rest + os.read(self._line_side, 4096)).split(b"\r")
            for line in lines:
                self._obey(line.decode("ascii", "replace"))

    def _obey(self, line: str) -> None:
        """Carry out one command; answer CR, or BEL where it is refused."""
        answer = "\r"
        with self._news:
            self.commands.append(line)
            match line[:1]:
                case "S" if not self.is_open and line[1:].isdecimal() and int(line[1:]) < len(BIT_RATES_BPS):
                    self.bit_rate_bps = BIT_RATES_BPS[int(line[1:])]
                case "O" | "L" if not self.is_open:
                    self.is_open, self.listen_only, self.bus_off = True, line[0] == "L", False
                case "C":
                    self.is_open = False
                case "F":
                    answer = "F00\r"  # status flags: none
                case "V":
                    answer = "V1013\r"
                case "N":
                    answer = "NBB01\r"
                case "" | "Z":
                    pass
                case "t" | "T" | "r" | "R" if self.is_open and not self.listen_only and not self.bus_off:
                    try:
                        self._received.append(SlcanFrame.parse(line))
                        answer = "z\r" if line[0].islower() else "Z\r"
                    except (ValueError, IndexError):
                        answer = "\a"
                case _:
                    answer = "\a"
            self._news.notify_all()
        os.write(self._line_side, answer.encode("ascii"))


def main() -> None:
    """Serve one adapter until standard input ends."""
    with SlcanDevice() as device:
        print(device.port, flush=True)

        def report() -> None:
            while True:
                with contextlib.suppress(TimeoutError):
                    print(device.receive().line(), flush=True)

        threading.Thread(target=report, daemon=True).start()
        for line in sys.stdin:
            device.send_line(line.strip())


if __name__ == "__main__":
    main()

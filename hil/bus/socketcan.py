"""The kernel's own CAN, vcan or an adapter's driver, straight from its raw socket.

python-can opens the same interfaces, at several times the cost per frame, waiting in wall time and without the kernel's
count of lost frames (SO_RXQ_OVFL breaks its reader): so this kind does without. Source: networking/can.rst of Linux.
"""

import contextlib
import errno
import os
import select
import socket
import struct
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bus.bus import BusError, BusSpec
from hil.bus.can_frame import CAN_FRAME, ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, REMOTE_FLAG, pack_frame
from hil.bus.error_frame import append_event, link_events
from hil.bus.wall_stamps import WallStamps
from hil.rt.clock import WallClock, monotonic_ns

_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL, _SO_MEMINFO = 33, 35, 40, 55  # asm-generic/socket.h
_MEMINFO = struct.Struct("=9I")  # linux/sock_diag.h; the last one counts drops
_CAN_RAW_ERR_FILTER = 2  # linux/can/raw.h
_RECEIVE_BYTES = 1 << 20  # the default holds about 250 frames
_ANCILLARY_BYTES = 128
_STAMP_SLACK_NS = 1_000_000  # the kernel stamps a frame before it queues it
_MOST_FRAMES = 1 << 14  # per receive: a babbling bus holds nobody up
_QUEUE_FULL = {errno.ENOBUFS, errno.EAGAIN}
_FIRST_RETRY_NS, _LAST_RETRY_NS = 10_000_000, 50_000_000  # a try is a bind: it costs nothing


class SocketcanBus:
    """A member on a SocketCAN interface.

    Parameters
    ----------
    spec : ``socketcan:INTERFACE``, no options: bit rate and listen-only belong to the link.
    bus : which of the two buses it carries.

    Raises
    ------
    BusError : no SocketCAN in this kernel, no such interface, interface down.
    """

    def __init__(self, spec: BusSpec, bus: BusName) -> None:
        if spec.options:
            raise BusError(
                f"bus {spec.name}: no options here, got {', '.join(spec.options)}; they are the link's own: "
                f"sudo ip link set {spec.channel} type can bitrate 500000 listen-only off"
            )
        self.name = spec.name
        self.bus = bus
        self.ignored = 0
        """Remote frames received: not of a data bus."""
        self._interface = spec.channel
        self._closed = False
        self._pending: list[Received] = []
        self._refused = 0
        self._dropped = 0
        self._retry_ns = _FIRST_RETRY_NS
        self._retry_at_ns = 0
        self._stamps = WallStamps(slack_ns=_STAMP_SLACK_NS)
        try:
            self._socket: socket.socket | None = _open(spec.channel)
        except OSError as error:
            raise BusError(f"bus {spec.name}: {_reason(spec.channel, error)}") from error
        self._note_bus_off()

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames; what the transmit queue does not take is dropped, not kept for later."""
        records = [pack_frame(frame, self.bus) for frame in frames]
        link = self._link()
        for number, record in enumerate(records):
            if link is None:
                self._refused += len(records) - number
                return
            try:
                link.send(record)
            except OSError as error:
                self._refused += 1
                if error.errno not in _QUEUE_FULL:
                    self._disconnect(error)
                    link = None

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is, in order; wait up to ``timeout_s`` for the first."""
        deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
        while True:
            link = self._link()
            received = self._report()
            if link is not None:
                try:
                    self._read(link, received)
                except OSError as error:
                    self._disconnect(error)
                    link = None
                    received += self._report()
            left_ns = deadline_ns - monotonic_ns()
            if received or left_ns <= 0:
                return received
            if link is None:
                WallClock().sleep_until(min(deadline_ns, self._retry_at_ns))
            else:
                ready = select.poll()
                ready.register(link, select.POLLIN)
                ready.poll(left_ns * 1e-6)

    def fileno(self) -> int:
        """Return the socket's descriptor; -1 while disconnected or closed."""
        return -1 if self._socket is None else self._socket.fileno()

    def close(self) -> None:
        """Leave the bus."""
        self._closed = True
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _link(self) -> socket.socket | None:
        """Return the socket; while disconnected, try to reopen it now and then."""
        if self._closed:
            raise ValueError(f"{self.name} is closed")
        if self._socket is None and monotonic_ns() >= self._retry_at_ns:
            try:
                self._socket = _open(self._interface)
            except OSError:
                self._retry_ns = min(2 * self._retry_ns, _LAST_RETRY_NS)
                self._retry_at_ns = monotonic_ns() + self._retry_ns
            else:
                self._dropped = 0
                self._retry_ns = _FIRST_RETRY_NS
                self._pending.append(LinkEvent(self.bus, LinkState.RESTARTED, monotonic_ns(), 1, "reconnected"))
                self._note_bus_off()
        return self._socket

    def _note_bus_off(self) -> None:
        """Report what no error frame reports: that the interface went bus-off before we joined."""
        if _without_carrier(self._interface):
            help_ = f"sudo ip link set {self._interface} type can restart, or down and up"
            detail = f"{self._interface} was bus-off before it was opened: {help_}"
            self._pending.append(LinkEvent(self.bus, LinkState.BUS_OFF, monotonic_ns(), 1, detail))

    def _disconnect(self, error: OSError) -> None:
        """Close the socket, after the frames that had arrived were taken from it."""
        link, self._socket = self._socket, None
        if link is not None:
            with contextlib.suppress(OSError):
                self._read(link, self._pending)
            link.close()
        self._retry_at_ns = monotonic_ns() + self._retry_ns
        detail = f"{self._interface}: {error.strerror}"
        self._pending.append(LinkEvent(self.bus, LinkState.DISCONNECTED, monotonic_ns(), 1, detail))

    def _report(self) -> list[Received]:
        """Return what happened while sending or reconnecting."""
        received, self._pending = self._pending, []
        if self._refused:
            event = LinkEvent(self.bus, LinkState.TX_OVERFLOW, monotonic_ns(), self._refused, "transmit queue full")
            received.append(event)
            self._refused = 0
        return received

    def _read(self, link: socket.socket, received: list[Received]) -> None:
        """Append what the socket holds.

        Raises
        ------
        OSError : the link's state; what was read before it is appended.
        """
        taken: list[tuple[bytes, int, int | None]] = []
        receive = link.recvmsg
        try:
            for _ in range(_MOST_FRAMES):
                record, ancillary, _, _ = receive(CAN_FRAME.size, _ANCILLARY_BYTES)
                stamp_ns, dropped = -1, None
                for _, kind, value in ancillary:
                    if kind == _SO_TIMESTAMPNS:
                        seconds, nanoseconds = struct.unpack("@ll", value)
                        stamp_ns = seconds * 1_000_000_000 + nanoseconds
                    elif kind == _SO_RXQ_OVFL:
                        dropped = int.from_bytes(value, sys.byteorder)
                taken.append((record, stamp_ns, dropped))
        except BlockingIOError:  # the frames' own count is of the time before them: were some lost after the last?
            now_ns = self._take(taken, received)
            self._count_drops(_drops(link, self._dropped), now_ns, received)
        except OSError:
            self._take(taken, received)
            raise
        else:
            self._take(taken, received)

    def _take(self, taken: list[tuple[bytes, int, int | None]], received: list[Received]) -> int:
        """Append records (with stamp and count of drops) as frames and events; the time they were read by, ns."""
        bus, now_ns = self.bus, self._stamps.look()
        for record, stamp_ns, dropped in taken:
            time_ns = self._stamps.monotonic_of(stamp_ns)
            if dropped is not None:
                self._count_drops(dropped, time_ns, received)
            flagged, length, data = CAN_FRAME.unpack(record)
            if flagged & ERROR_FLAG:
                for event in link_events(flagged & EXTENDED_MASK, data, bus, time_ns):
                    append_event(event, received)
            elif flagged & REMOTE_FLAG:
                self.ignored += 1
            elif flagged & EXTENDED_FLAG:
                received.append(Frame(bus, flagged ^ EXTENDED_FLAG, data[:length], time_ns, True))
            else:
                received.append(Frame(bus, flagged, data[:length], time_ns))
        return now_ns

    def _count_drops(self, dropped: int, time_ns: int, received: list[Received]) -> None:
        lost = (dropped - self._dropped) & 0xFFFFFFFF
        if 0 < lost < 1 << 31:  # beyond: a frame's count from before the one we asked for
            self._dropped = dropped
            received.append(LinkEvent(self.bus, LinkState.RX_OVERFLOW, time_ns, lost, "socket's queue full"))


def _drops(link: socket.socket, known: int) -> int:
    """Frames dropped so far for want of room; ``known`` where the kernel does not say (before 4.12)."""
    try:
        return int(_MEMINFO.unpack(link.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMINFO.size))[-1])
    except OSError:
        return known


def _without_carrier(interface: str) -> bool:
    """Whether an interface that is up has no carrier: a CAN driver takes it away at bus-off."""
    try:
        return Path(f"/sys/class/net/{interface}/carrier").read_text().strip() == "0"
    except OSError:
        return False


def _open(interface: str) -> socket.socket:
    """Bind a raw socket; OSError where the interface is missing or down."""
    link = socket.socket(socket.AF_CAN, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.CAN_RAW)
    try:
        link.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, EXTENDED_MASK)
        link.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        link.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        try:
            link.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BYTES)
        except PermissionError:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)
        link.bind((interface,))
        if code := link.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):  # an interface that is down can be bound
            raise OSError(code, os.strerror(code))
    except OSError:
        link.close()
        raise
    return link


def _reason(interface: str, error: OSError) -> str:
    helps = {
        errno.EAFNOSUPPORT: "this kernel has no SocketCAN: sudo modprobe can-raw, or use loopback:NAME",
        errno.ENODEV: f"see `ip link`; a virtual one: sudo ip link add dev {interface} type vcan",
        errno.ENETDOWN: f"bring it up: sudo ip link set {interface} up",
    }
    help_ = helps.get(error.errno or 0)
    return f"{error.strerror or error}; {help_}" if help_ else str(error)

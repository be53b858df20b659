"""A CAN bus between processes of one machine, without kernel CAN and without a hub.

Every member binds a seqpacket Unix socket in its channel's directory (`hil.bus.rendezvous`); a joiner connects to each
member present, members accept later joiners whenever they send or receive. So any member may die: the others stay
joined. A member's full queue costs that member frames (it learns how many), never anybody's time.
Packets: `hil.bus.loopback_wire`.
"""

import contextlib
import select
import socket
import struct
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bus.loopback_wire import MAX_FRAMES, MAX_PACKET, pack_frames, pack_header, unpack
from hil.bus.rendezvous import Rendezvous
from hil.rt.clock import monotonic_ns

QUEUE_BYTES = 1 << 20
"""Asked of the kernel per peer, a few hundred packets at least; beyond it that peer loses frames."""

MOST_PACKETS = 1 << 14
"""Read of one peer at a time, more than its queue can hold: one that floods the bus holds nobody up."""

_SO_SNDBUFFORCE = 32  # asm-generic/socket.h; needs CAP_NET_ADMIN


class _Peer:
    """The connection to one other member."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        try:
            connection.setsockopt(socket.SOL_SOCKET, _SO_SNDBUFFORCE, QUEUE_BYTES)
        except PermissionError:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE_BYTES)
        credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        self.pid = struct.unpack("3i", credentials)[0]
        self.connection = connection
        self.addressed = 0  # frames sent or lost on the way to it
        self.heard = 0  # frames it sent or lost on the way to us
        self.takes = True  # False once it has closed: its last frames may still be to be read


class LoopbackBus:
    """One member of a loopback channel; a process may hold several.

    Parameters
    ----------
    channel : letters, digits, ``.``, ``_`` and ``-``; whoever uses the same joins.
    bus : which of the two buses it carries.

    Raises
    ------
    BusError : bad channel name, no usable directory.
    """

    def __init__(self, channel: str, bus: BusName) -> None:
        self.name = f"loopback:{channel}"
        self.bus = bus
        self.garbage = 0
        """Packets ignored because they were not ours."""
        self._sent_lost = 0
        self._sent_lost_to: set[int] = set()
        self._peers: dict[int, _Peer] = {}
        self._epoll = select.epoll()
        self._joiners = select.poll()
        self._rendezvous = Rendezvous(channel)
        try:
            self._listener, present = self._rendezvous.join()
        except BaseException:
            self._epoll.close()
            raise
        self._joiners.register(self._listener, select.POLLIN)
        self._epoll.register(self._listener, select.EPOLLIN)
        for connection in present:
            self._add(connection)

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames to all members but this one, in packets of up to `MAX_FRAMES`."""
        if self._epoll.closed:
            raise ValueError(f"{self.name} is closed")
        if self._joiners.poll(0):
            self._accept()
        time_ns = monotonic_ns()
        for start in range(0, len(frames), MAX_FRAMES):
            records = pack_frames(frames[start : start + MAX_FRAMES], self.bus)
            count = min(MAX_FRAMES, len(frames) - start)
            for peer in list(self._peers.values()):
                if peer.takes:
                    self._send_to(peer, count, time_ns, records)

    def _send_to(self, peer: _Peer, count: int, time_ns: int, records: bytes) -> None:
        packet = pack_header(count, peer.addressed, time_ns) + records
        peer.addressed += count
        try:
            peer.connection.send(packet, socket.MSG_NOSIGNAL)
        except (BrokenPipeError, ConnectionResetError):
            peer.takes = False
        except OSError:  # EAGAIN: its queue is full; ENOBUFS, ENOMEM: the machine's memory is
            self._sent_lost += count
            self._sent_lost_to.add(peer.pid)

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is: in order per member, by time of sending between members."""
        if self._epoll.closed:
            raise ValueError(f"{self.name} is closed")
        received = self._drain(0.0)
        if received or timeout_s <= 0:
            return received
        deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
        while not received and (left_ns := deadline_ns - monotonic_ns()) > 0:
            received = self._drain(left_ns * 1e-9)
        return received

    def fileno(self) -> int:
        """Return a descriptor that is readable when a member sent, joined or left; -1 when closed."""
        return -1 if self._epoll.closed else self._epoll.fileno()

    def close(self) -> None:
        """Leave; what was sent before is still delivered."""
        if self._epoll.closed:
            return
        self._epoll.close()
        self._rendezvous.leave(self._listener)
        for peer in self._peers.values():
            peer.connection.close()
        self._peers.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _drain(self, timeout_s: float) -> list[Received]:
        heard: list[list[Received]] = []
        for file, _ in self._epoll.poll(timeout_s):
            readable = self._accept() if file == self._listener.fileno() else [file]
            heard += [batch for ready in readable if (batch := self._read(ready))]
        if self._sent_lost:
            detail = f"queue full of process {', '.join(map(str, sorted(self._sent_lost_to)))}"
            event = LinkEvent(self.bus, LinkState.TX_OVERFLOW, monotonic_ns(), self._sent_lost, detail)
            heard.append([event])
            self._sent_lost = 0
            self._sent_lost_to.clear()
        if len(heard) == 1:
            return heard[0]
        return sorted((item for batch in heard for item in batch), key=lambda item: item.time_ns)

    def _read(self, file: int) -> list[Received]:
        """Read one peer until it has nothing more."""
        peer = self._peers.get(file)
        if peer is None:
            return []
        received: list[Received] = []
        receive = peer.connection.recv
        for _ in range(MOST_PACKETS):
            try:
                packet = receive(MAX_PACKET + 1)
            except BlockingIOError:
                return received
            except ConnectionResetError:  # it closed without having read all: said once, its last packets follow
                continue
            except OSError:
                packet = b""
            if not packet:
                self._drop(file)
                return received
            content = unpack(packet, self.bus)
            if content is None or content[0] < peer.heard:
                self.garbage += 1
                continue
            sequence, frames = content
            if sequence > peer.heard:
                detail = f"from process {peer.pid}"
                event = LinkEvent(self.bus, LinkState.RX_OVERFLOW, frames[0].time_ns, sequence - peer.heard, detail)
                received.append(event)
            peer.heard = sequence + len(frames)
            received += frames
        return received

    def _accept(self) -> list[int]:
        """Accept whoever joined, without waiting; return their descriptors."""
        accepted: list[int] = []
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:  # nobody more; or gone again; or out of descriptors, retried at the next call
                return accepted
            accepted.append(self._add(connection))

    def _add(self, connection: socket.socket) -> int:
        file = connection.fileno()
        try:
            self._peers[file] = _Peer(connection)
            self._epoll.register(file, select.EPOLLIN)
        except OSError:  # it left in the same moment
            self._drop(file)
            connection.close()
        return file

    def _drop(self, file: int) -> None:
        peer = self._peers.pop(file, None)
        if peer is not None:
            with contextlib.suppress(OSError):
                self._epoll.unregister(file)
            peer.connection.close()

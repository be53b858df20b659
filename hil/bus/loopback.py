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
from hil.bus.can_frame import pack_frame
from hil.bus.loopback_wire import MAX_FRAMES, MAX_PACKET, pack_event, pack_header, unpack
from hil.bus.rendezvous import Rendezvous
from hil.rt.clock import monotonic_ns

QUEUE_BYTES = 1 << 20
"""Asked of the kernel per peer, a few hundred packets at least; beyond it that peer loses frames."""

MOST_ROUNDS = 1 << 14
"""Packets read of a peer at a time, more than its queue can hold: one that floods the bus holds nobody up."""

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
        self._untold: set[_Peer] = set()  # lost frames, and got none since that would tell them
        self._peers: dict[int, _Peer] = {}
        self._epoll = select.epoll()
        self._joiners = select.poll()
        self._rendezvous = Rendezvous(channel)
        try:
            self._listener, present = self._rendezvous.join()
        except BaseException:
            self._epoll.close()
            raise
        self._listener_file = self._listener.fileno()
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
        records = [pack_frame(frame, self.bus) for frame in frames]  # all of them, before the first is sent
        self._send_records(records, monotonic_ns())

    def relay(self, heard: Sequence[Received]) -> None:
        """Pass on what was heard on another bus, frames and link events, each with its own time."""
        if self._joiners.poll(0):
            self._accept()
        for item in heard:
            record = pack_frame(item, self.bus) if isinstance(item, Frame) else pack_event(item)
            self._send_records([record], max(0, item.time_ns))

    def _send_records(self, records: list[bytes], time_ns: int) -> None:
        for start in range(0, len(records), MAX_FRAMES):
            chunk = records[start : start + MAX_FRAMES]
            packed = b"".join(chunk)
            for peer in list(self._peers.values()):
                if peer.takes:
                    self._send_to(peer, len(chunk), time_ns, packed)

    def _send_to(self, peer: _Peer, count: int, time_ns: int, records: bytes) -> None:
        packet = pack_header(count, peer.addressed, time_ns) + records
        peer.addressed += count
        try:
            peer.connection.send(packet, socket.MSG_NOSIGNAL)
            self._untold.discard(peer)
        except (BrokenPipeError, ConnectionResetError):
            peer.takes = False
            self._untold.discard(peer)
        except OSError:  # EAGAIN: its queue is full; ENOBUFS, ENOMEM: the machine's memory is
            self._untold.add(peer)
            if count:
                self._sent_lost += count
                self._sent_lost_to.add(peer.pid)

    def _tell_losses(self) -> None:
        """Tell those who lost frames how many, as soon as they have room: nothing else may follow for long."""
        for peer in list(self._untold):
            self._send_to(peer, 0, monotonic_ns(), b"")

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is: in order per member, by time of sending between members."""
        if self._epoll.closed:
            raise ValueError(f"{self.name} is closed")
        received: list[Received] = []
        if self._untold:
            self._tell_losses()
        if self._sent_lost:
            received.append(self._not_taken())
            timeout_s = 0.0
        if timeout_s <= 0:
            self._drain(0.0, received)
            return received
        deadline_ns = monotonic_ns() + int(timeout_s * 1e9)
        while not received and timeout_s > 0:
            self._drain(timeout_s, received)
            timeout_s = (deadline_ns - monotonic_ns()) * 1e-9
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

    def _drain(self, timeout_s: float, received: list[Received]) -> None:
        """Append what the members sent: a packet of each in turn, until nobody has more."""
        heard = set()
        for _ in range(MOST_ROUNDS):
            ready = self._epoll.poll(timeout_s)
            timeout_s = 0.0
            progress = False
            for file, _ in ready:
                if file == self._listener_file:
                    progress |= self._accept()
                else:
                    progress = True
                    heard.add(file)
                    self._read(file, received)
            if not progress:
                break
        if len(heard) > 1:
            received.sort(key=lambda item: item.time_ns)

    def _read(self, file: int, received: list[Received]) -> None:
        """Append one packet's content."""
        peer = self._peers.get(file)
        if peer is None:  # dropped by a sending thread in the same moment
            return
        try:
            packet = peer.connection.recv(MAX_PACKET + 1)
        except (BlockingIOError, ConnectionResetError):  # reset: it left unread what we sent; its last packets follow
            return
        except OSError:
            packet = b""
        if not packet:
            self._drop(file)
            return
        content = unpack(packet, self.bus)
        if content is None or content[0] < peer.heard + (not content[1]):  # without frames it must tell of a loss
            self.garbage += 1
            return
        sequence, frames = content
        if sequence > peer.heard:
            lost, detail = sequence - peer.heard, f"from process {peer.pid}"
            time_ns = frames[0].time_ns if frames else monotonic_ns()
            received.append(LinkEvent(self.bus, LinkState.RX_OVERFLOW, time_ns, lost, detail))
        peer.heard = sequence + len(frames)
        received += frames

    def _not_taken(self) -> LinkEvent:
        detail = f"queue full of process {', '.join(map(str, sorted(self._sent_lost_to)))}"
        event = LinkEvent(self.bus, LinkState.TX_OVERFLOW, monotonic_ns(), self._sent_lost, detail)
        self._sent_lost = 0
        self._sent_lost_to.clear()
        return event

    def _accept(self) -> bool:
        """Accept whoever joined, without waiting; return whether somebody did."""
        accepted = False
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:  # nobody more; or gone again; or out of descriptors, retried at the next call
                return accepted
            self._add(connection)
            accepted = True

    def _add(self, connection: socket.socket) -> None:
        file = connection.fileno()
        try:
            self._peers[file] = _Peer(connection)
            self._epoll.register(file, select.EPOLLIN)
        except OSError:  # it left in the same moment
            self._drop(file)
            connection.close()

    def _drop(self, file: int) -> None:
        peer = self._peers.pop(file, None)
        if peer is not None:
            self._untold.discard(peer)
            with contextlib.suppress(OSError):
                self._epoll.unregister(file)
            peer.connection.close()

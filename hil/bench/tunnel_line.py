"""The TCP side of a tunnel: one connection at a time, waited for or sought, never blocking."""

import contextlib
import errno
import os
import select
import socket
from collections.abc import Callable

from dbc.frame import Received
from hil.bus.tunnel_end import TunnelCounts, TunnelEnd
from hil.bus.tunnel_wire import HELLO
from hil.errors import BrakebenchError, in_words
from hil.rt.clock import monotonic_ns

SILENCE_NS = 1_000_000_000
"""An end that says or takes nothing for so long is gone: TCP's first repetitions, after 0.2 and 0.6 s, are over."""

_SEEK_NS = 500_000_000  # from one attempt to connect to the next
_READ_BYTES = 1 << 16
_SEND_BYTES = 1 << 14  # asked of the kernel: half a second of a full bus, what queues beyond is dropped by its age here


class PlaceError(BrakebenchError):
    """Not the place of a tunnel's other end."""


class LostError(BrakebenchError):
    """The connection is lost."""


def parse_place(text: str, host: str = "") -> tuple[str, int]:
    """Parse ``HOST:PORT``; the host may be left out where ``host`` is its default.

    Raises
    ------
    PlaceError : not of that form.
    """
    name, _, port = text.rpartition(":")
    name = name.removeprefix("[").removesuffix("]") or host
    if not name or not (port.isascii() and port.isdigit()) or int(port) > 0xFFFF:
        raise PlaceError(
            f"tunnel: expected {'[HOST:]PORT' if host else 'HOST:PORT'}, such as 127.0.0.1:7400, got {text}"
        )
    return name, int(port)


def _addresses(place: tuple[str, int]) -> list[tuple[socket.AddressFamily, tuple[object, ...]]]:
    try:
        return [(one[0], one[4]) for one in socket.getaddrinfo(*place, type=socket.SOCK_STREAM)]
    except (OSError, UnicodeError) as error:
        raise PlaceError(f"tunnel: {place[0]}: {in_words(error)}") from error


def _name(address: tuple[object, ...]) -> str:
    return f"{address[0]}:{address[1]}"


class Connection:
    """One TCP connection to the other end."""

    def __init__(self, connected: socket.socket, who: str, lifetime_ns: int, counts: TunnelCounts) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        self.who = who
        self.end = TunnelEnd(lifetime_ns, counts)
        self.socket = connected
        self._out = HELLO
        self._heard_ns = self._taken_ns = monotonic_ns()

    @property
    def blocked(self) -> bool:
        """Whether something waits for room to be sent."""
        return bool(self._out)

    def receive(self) -> list[Received]:
        """Return what came; LostError or GarbledError where it ends."""
        try:
            data = self.socket.recv(_READ_BYTES)
        except BlockingIOError:
            if monotonic_ns() - self._heard_ns > SILENCE_NS:
                raise LostError(f"nothing heard for {SILENCE_NS * 1e-9:g} s") from None
            return []
        except OSError as error:
            raise LostError(error.strerror or str(error)) from error
        if not data:
            raise LostError("the other end closed the connection")
        self._heard_ns = monotonic_ns()
        return self.end.feed(data, self._heard_ns)

    def send(self) -> None:
        """Send what is due, as far as the connection takes it; LostError where it ends."""
        now_ns = monotonic_ns()
        if not self._out:
            self._taken_ns = now_ns
            self._out = self.end.packets(now_ns)
        try:
            while self._out:
                taken = self.socket.send(self._out, socket.MSG_NOSIGNAL)
                self._out = self._out[taken:]
                self._taken_ns = now_ns
        except BlockingIOError:
            self.end.expire(now_ns)
            if now_ns - self._taken_ns > SILENCE_NS:
                raise LostError(f"the other end took nothing for {SILENCE_NS * 1e-9:g} s") from None
        except OSError as error:
            raise LostError(error.strerror or str(error)) from error


class Listener:
    """Waits for the other end; one at a time.

    Parameters
    ----------
    place : host and port to bind; port 0 takes a free one.
    say : takes messages for people.

    Raises
    ------
    PlaceError : it cannot be bound.
    """

    def __init__(self, place: tuple[str, int], say: Callable[[str], None]) -> None:
        family, address = _addresses(place)[0]
        self._socket = socket.socket(family, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        self._say = say
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(address)
            self._socket.listen()
        except OSError as error:
            self._socket.close()
            raise PlaceError(f"tunnel: cannot listen on {_name(address)}: {error.strerror}") from error
        self.words = f"listens on {_name(self._socket.getsockname())}"
        if not str(address[0]).startswith("127.") and address[0] != "::1":
            self.words += ": WITHOUT authentication, whoever reaches that address may send on both buses"

    def next(self, busy: bool) -> tuple[socket.socket, str] | None:
        """Return who has connected; turned away where there is a connection already."""
        try:
            connected, address = self._socket.accept()
        except OSError:
            return None
        if not busy:
            return connected, _name(address)
        connected.close()
        self._say(f"tunnel: {_name(address)} turned away: a tunnel has two ends, and the other one is here already")
        return None

    def watch(self, poll: select.poll) -> None:
        """Have a poll end when somebody comes."""
        poll.register(self._socket, select.POLLIN)

    def close(self) -> None:
        """Listen no longer."""
        self._socket.close()


class Seeker:
    """Connects to the other end, again and again; parameters and errors as of `Listener`."""

    def __init__(self, place: tuple[str, int], say: Callable[[str], None]) -> None:
        self._addresses = _addresses(place)  # of a name there may be several: in turns
        self._family, self._address = self._addresses[0]
        self._socket: socket.socket | None = None
        self._say = say
        self._said = ""
        self._due_ns = 0
        self.words = f"connects to {_name(self._address)}"

    def next(self, busy: bool) -> tuple[socket.socket, str] | None:
        """Return the connection, once there is one."""
        now_ns = monotonic_ns()
        if busy:
            self._due_ns, self._said = now_ns + _SEEK_NS, ""
            return None
        if self._socket is None:
            if now_ns < self._due_ns:
                return None
            self._due_ns = now_ns + _SEEK_NS
            self._socket = socket.socket(self._family, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
            code = self._socket.connect_ex(self._address)
        else:
            poll = select.poll()
            poll.register(self._socket, select.POLLOUT)
            code = errno.EINPROGRESS
            if poll.poll(0):
                code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code == errno.EINPROGRESS:
            return None
        sought, self._socket = self._socket, None
        # a port nobody listens on may be given to us for this very attempt: we would speak with ourselves
        if not code and sought.getsockname() == sought.getpeername():
            code = errno.ECONNREFUSED
        if code:
            sought.close()
            self._addresses.append(self._addresses.pop(0))
            self._family, self._address = self._addresses[0]
            if os.strerror(code) != self._said:
                self._said = os.strerror(code)
                self._say(f"tunnel: {self.words}: {self._said}; tried again every {_SEEK_NS * 1e-9:g} s")
            return None
        return sought, _name(self._address)

    def watch(self, poll: select.poll) -> None:
        """Have a poll end when the attempt under way does."""
        if self._socket is not None:
            poll.register(self._socket, select.POLLOUT)

    def close(self) -> None:
        """Seek no longer."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()

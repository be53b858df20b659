"""A vehicle bus and its bench bus on two machines: two loopbacks, one on each, and a TCP connection between them."""

import contextlib
import select
from collections.abc import Callable, Sequence

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bench.tunnel_line import Connection, Listener, LostError, Seeker
from hil.bus.bus import parse_spec
from hil.bus.channel import bench_channel, claim_tunnel, resolve
from hil.bus.loopback import LoopbackBus
from hil.bus.tunnel_end import HEARTBEAT_NS, TunnelCounts
from hil.bus.tunnel_wire import GarbledError
from hil.errors import BrakebenchError
from hil.rt.clock import monotonic_ns
from hil.rt.process import StopSignal
from hil.rt.realtime import request_punctuality
from plant.demands import DEMAND_TIMEOUT_NS

LIFETIME_NS = DEMAND_TIMEOUT_NS // 2
"""Frames older than that do not pass: half of what the brake waits for a demand, the rest is for the next frame."""

_IDLE_NS = 50_000_000  # how often a stop is looked at without a connection
_TELL_NS = 1_000_000_000  # what was dropped is said at most that often
_MS = 1e-6


class TunnelError(BrakebenchError):
    """No bus that a tunnel joins."""


class Tunnel:
    """One end: two loopbacks of this machine, and the connection when there is one.

    Parameters
    ----------
    buses : vehicle bus and bench bus.
    line : where the other end comes from.
    lifetime_ns : frames older than that are dropped.
    say : takes messages for people.
    """

    def __init__(
        self, buses: Sequence[LoopbackBus], line: Listener | Seeker, lifetime_ns: int, say: Callable[[str], None]
    ) -> None:
        self.counts = TunnelCounts()
        self._buses = buses
        self._line = line
        self._lifetime_ns = lifetime_ns
        self._say = say
        self._connection: Connection | None = None
        self._told = False  # whether the buses know that there is a connection
        self._ended = ""  # why the last connection did
        self._said = 0
        self._said_ns = 0
        self._round_trip_ns = 0

    def turn(self) -> None:
        """Wait for something to do, and do it."""
        self._wait()
        heard = [item for bus in self._buses for item in bus.receive(0.0)]
        come = self._line.next(self._connection is not None)
        if come is not None:
            self._connection = Connection(*come, self._lifetime_ns, self.counts)
        connection = self._connection
        try:
            passed = connection.receive() if connection else []
            if connection and connection.end.joined:
                self._tell(connection)
                connection.end.offer(heard)
            else:
                self.counts.disconnected += sum(isinstance(item, Frame) for item in heard)
            self._pass_on(passed)
            if connection:
                connection.send()
        except (LostError, GarbledError) as error:
            self._lose(str(error))
        self._report()

    def close(self, why: str = "ended here") -> None:
        """Leave the other end, and tell the members here."""
        if self._connection is not None:
            self._lose(why)
        self._report(final=True)

    def _wait(self) -> None:
        poll = select.poll()
        for bus in self._buses:
            poll.register(bus.fileno(), select.POLLIN)
        self._line.watch(poll)
        timeout_ns = _IDLE_NS
        if self._connection is not None:
            poll.register(self._connection.socket, select.POLLIN | (select.POLLOUT if self._connection.blocked else 0))
            timeout_ns = HEARTBEAT_NS
        poll.poll(timeout_ns * _MS)

    def _tell(self, connection: Connection) -> None:
        self._round_trip_ns = connection.end.round_trip_ns
        if not self._told:
            self._told = True
            self._say(f"tunnel: connected with {connection.who}")
            self._events(LinkState.RESTARTED, "tunnel connected")

    def _lose(self, why: str) -> None:
        connection, self._connection = self._connection, None
        assert connection is not None
        connection.socket.close()
        # behind `ssh -L` every attempt connects, and ends at once as long as the other end is not there: said once
        if self._told or why != self._ended:
            self._say(f"tunnel: connection with {connection.who} ended: {why}")
        self._ended = why
        if self._told:
            self._told = False
            self._events(LinkState.DISCONNECTED, "tunnel lost")

    def _events(self, state: LinkState, detail: str) -> None:
        for bus in self._buses:
            bus.relay([LinkEvent(bus.bus, state, monotonic_ns(), 1, detail)])

    def _pass_on(self, passed: Sequence[Received]) -> None:
        for bus in self._buses:
            bus.relay([item for item in passed if item.bus is bus.bus])

    def _report(self, final: bool = False) -> None:
        """Say what was dropped for its age, not more often than people read."""
        counts = self.counts
        now_ns = monotonic_ns()
        if counts.too_old != self._said and (final or now_ns - self._said_ns >= _TELL_NS):
            self._said, self._said_ns = counts.too_old, now_ns
            self._say(
                f"tunnel: frames older than {self._lifetime_ns * _MS:g} ms dropped so far: "
                f"{counts.too_old_to_send} before sending, {counts.too_old_on_arrival} on arrival, "
                f"{counts.too_old_there} at the other end"
            )
        if final:
            self._say(
                f"tunnel: {counts.sent} frames sent, {counts.passed} passed on, {counts.too_old} dropped for their "
                f"age, {counts.disconnected} heard without a connection; ages were taken too large by "
                f"{self._round_trip_ns * _MS:.2f} ms at most"
            )


def serve_tunnel(
    spec: str,
    place: tuple[str, int],
    *,
    listen: bool,
    lifetime_ns: int = LIFETIME_NS,
    realtime: bool = False,
    say: Callable[[str], None] = lambda _: None,
) -> None:
    """Join a loopback and its bench bus with those of the other end, until SIGTERM or Ctrl-C.

    Frames and link events of both buses pass both ways; frames that are too old are dropped, and told as frames lost on
    the way. A connection that is lost is told as an unplugged adapter is, and made again.

    Parameters
    ----------
    spec : the loopback.
    place : host and port; where to ``listen``, else where to connect to.
    lifetime_ns : frames older than that are dropped, in both directions.
    realtime, say : as of `hil.bench.node_process.serve`.

    Raises
    ------
    TunnelError : no loopback.
    hil.bus.bus.BusError : the loopback has an end of a tunnel already.
    hil.bench.tunnel_line.PlaceError : it cannot be listened on, or there is no such host.
    """
    stop = StopSignal()
    spec = resolve(spec)
    parsed = parse_spec(spec)
    if parsed.kind != "loopback":
        raise TunnelError(
            f"tunnel: {spec}: expected a loopback, such as loopback:car; `brakebench share` puts an adapter on one"
        )
    with contextlib.ExitStack() as stack:
        with stop.at_once():
            stack.enter_context(contextlib.closing(claim_tunnel(parsed)))
            line = stack.enter_context(contextlib.closing((Listener if listen else Seeker)(place, say)))
            buses = [
                stack.enter_context(LoopbackBus(parse_spec(name).channel, bus))
                for name, bus in ((spec, BusName.VEHICLE), (bench_channel(spec), BusName.BENCH))
            ]
            request_punctuality(realtime, lambda text: say(f"tunnel: {text}"))
            say(f"tunnel: {spec} {line.words}")
        tunnel = Tunnel(buses, line, lifetime_ns, say)
        try:
            while not stop.asked:
                tunnel.turn()
        finally:
            tunnel.close()

"""One end of a tunnel without its socket: the age of frames over two clocks, and what is dropped for it.

Clocks of two machines have nothing in common. Each end tells the other by how much its clock is ahead, *at most*: the
least of (heard by its clock - sent by the other's) over the last packets, for no packet takes less than no time. With
that bound an age is never taken too small, however long packets queue, on the way or at an end that was stopped; it is
taken too large by the way of the fastest packet back.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from dbc.frame import BusName, Frame, LinkEvent, LinkState, Received
from hil.bus.tunnel_wire import MAX_RECORDS, UNKNOWN, Packet, PacketReader, pack

HEARTBEAT_NS = 10_000_000
"""A packet goes out at least this often: one cycle of the fast messages, so that clocks are compared all the time."""

_WINDOW_NS = 1_000_000_000  # bounds live one to two of it: clocks 500 ppm apart (the most NTP slews) part by 1 ms


@dataclass
class TunnelCounts:
    """Frames of one end, over all its connections."""

    sent: int = 0
    passed: int = 0  # from the other end to our buses
    too_old_to_send: int = 0  # here, before they were sent
    too_old_on_arrival: int = 0  # here, from the other end
    too_old_there: int = 0  # dropped by the other end, theirs before sending and ours on arrival
    disconnected: int = 0  # heard on our buses while there was no connection

    @property
    def too_old(self) -> int:
        """All that were dropped for their age, both ways."""
        return self.too_old_to_send + self.too_old_on_arrival + self.too_old_there


class _Least:
    """The least of what was noted during the last one to two windows."""

    def __init__(self) -> None:
        self._begun_ns = 0
        self._now: int | None = None
        self._before: int | None = None

    def note(self, value: int, now_ns: int) -> None:
        if now_ns - self._begun_ns >= _WINDOW_NS:
            self._before = self._now if now_ns - self._begun_ns < 2 * _WINDOW_NS else None
            self._begun_ns, self._now = now_ns, None
        self._now = value if self._now is None else min(value, self._now)

    @property
    def value(self) -> int | None:
        return min((value for value in (self._now, self._before) if value is not None), default=None)


class TunnelEnd:
    """One connection's end.

    Parameters
    ----------
    lifetime_ns : frames older than that are dropped, before sending and on arrival.
    counts : goes on over connections.

    Attributes
    ----------
    joined : whether the other end has spoken; before, there is nothing to offer it.
    round_trip_ns : of the fastest packets there and back lately: how far ages may be taken too large, at most.
    """

    def __init__(self, lifetime_ns: int, counts: TunnelCounts) -> None:
        self.joined = False
        self.round_trip_ns = 0
        self._lifetime_ns = lifetime_ns
        self._counts = counts
        self._reader = PacketReader()
        self._ahead = _Least()
        self._queue: list[Received] = []
        self._unsent = self._refused = 0
        self._told_there = 0
        self._packed_ns: int | None = None

    def offer(self, items: Iterable[Received]) -> None:
        """Queue what was heard on this end's buses."""
        self._queue += items

    def expire(self, now_ns: int) -> None:
        """Drop queued frames that are too old; the other side is told as of a member that lost frames."""
        young: list[Received] = []
        old: list[Received] = []
        for item in self._queue:
            (old if isinstance(item, Frame) and now_ns - item.time_ns > self._lifetime_ns else young).append(item)
        if old:
            self._unsent += len(old)
            self._counts.too_old_to_send += len(old)
            self._queue = [*_losses(old, now_ns), *young]

    def packets(self, now_ns: int) -> bytes:
        """Return what is to be sent now: all that is queued, or a heartbeat where it is time for one, or nothing."""
        self.expire(now_ns)
        due = self._packed_ns is None or now_ns - self._packed_ns >= HEARTBEAT_NS
        if not (self._queue and self.joined) and not due:
            return b""
        self._packed_ns = now_ns
        ahead = self._ahead.value
        items = self._queue if self.joined else []
        out = b""
        for start in range(0, len(items) or 1, MAX_RECORDS):
            part = items[start : start + MAX_RECORDS]
            out += pack(Packet(now_ns, UNKNOWN if ahead is None else ahead, self._unsent, self._refused, part))
        self._counts.sent += sum(isinstance(item, Frame) for item in items)
        self._queue = []
        return out

    def feed(self, data: bytes, now_ns: int) -> list[Received]:
        """Return what goes to this end's buses, with times by this machine's clock.

        Raises
        ------
        hil.bus.tunnel_wire.GarbledError : the other end speaks something else.
        """
        passed: list[Received] = []
        old: list[Received] = []
        for packet in self._reader.feed(data):
            self.joined = True
            self._ahead.note(now_ns - packet.sent_ns, now_ns)
            there = packet.unsent + packet.refused
            self._counts.too_old_there += max(0, there - self._told_there)
            self._told_there = there
            if packet.ahead_ns == UNKNOWN:
                continue
            self.round_trip_ns = max(0, packet.ahead_ns + (self._ahead.value or 0))
            for item in packet.items:
                time_ns = max(0, min(now_ns, item.time_ns - packet.ahead_ns))
                if isinstance(item, Frame) and now_ns - time_ns > self._lifetime_ns:
                    old.append(item)
                else:
                    passed.append(item._replace(time_ns=time_ns))
        self._refused += len(old)
        self._counts.too_old_on_arrival += len(old)
        self._counts.passed += sum(isinstance(item, Frame) for item in passed)
        return [*_losses(old, now_ns), *passed]


def _losses(old: list[Received], now_ns: int) -> list[Received]:
    """What members of the other buses are told of frames that were dropped: as of any frames lost on the way."""
    counts = [(bus, sum(item.bus is bus for item in old)) for bus in BusName]
    detail = "too old in the tunnel"
    return [LinkEvent(bus, LinkState.RX_OVERFLOW, now_ns, count, detail) for bus, count in counts if count]

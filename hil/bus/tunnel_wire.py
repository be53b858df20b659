"""What two ends of a tunnel say to each other over a stream: pure bytes, no socket.

Each end begins with `HELLO`; packets follow, big-endian:

    offset  size      field
    0       2         count      records in this packet, 0..64
    2       8         sent_ns    the sender's CLOCK_MONOTONIC when it packed this, ns
    10      8         ahead_ns   how far the sender's clock is ahead of the receiver's, at most, ns
    18      8         unsent     frames the sender dropped for their age on this connection before they were packed
    26      8         refused    frames of the receiver that the sender dropped for their age on arrival
    34      25 count  records

A record: bus (0 vehicle, 1 bench), identifier with the flags of `hil.bus.can_frame`, length, number of occurrences of a
link event (3 bytes, 0 of a frame), 8 data bytes, and its time (8 bytes) by the sender's clock. A link event is an error
frame (`hil.bus.error_frame`).
"""

import struct
from typing import NamedTuple

from dbc.frame import BusName, Frame, Received
from hil.bus.can_frame import ERROR_FLAG, EXTENDED_FLAG, EXTENDED_MASK, STANDARD_MASK
from hil.bus.error_frame import MOST_NUMBER, error_frame, event_of_record
from hil.errors import BrakebenchError

HELLO = b"BBTUNL1\n"
MAX_RECORDS = 64
UNKNOWN = -(1 << 63)
"""``ahead_ns`` of an end that has heard nothing yet; it sends no records."""

_HEADER = struct.Struct("!HqqQQ")
_RECORD = struct.Struct("!BIB3s8sq")
_BUSES = (BusName.VEHICLE, BusName.BENCH)
_SHOWN = 24  # bytes of what was expected to be something else


class GarbledError(BrakebenchError):
    """The other end does not speak this protocol."""


class Packet(NamedTuple):
    """One packet; fields as on the wire, ``items`` with times by the sender's clock."""

    sent_ns: int
    ahead_ns: int
    unsent: int
    refused: int
    items: list[Received]


def pack(packet: Packet) -> bytes:
    """Return a packet of up to `MAX_RECORDS` items as bytes."""
    sent_ns, ahead_ns, unsent, refused, items = packet
    return _HEADER.pack(len(items), sent_ns, ahead_ns, unsent, refused) + b"".join(map(_record, items))


def _record(item: Received) -> bytes:
    bus = _BUSES.index(item.bus)
    if isinstance(item, Frame):
        flagged = item.can_id | EXTENDED_FLAG if item.extended else item.can_id
        return _RECORD.pack(bus, flagged, len(item.data), b"\0\0\0", item.data, item.time_ns)
    error_class, data = error_frame(item)
    number = min(item.number, MOST_NUMBER).to_bytes(3, "big")
    return _RECORD.pack(bus, ERROR_FLAG | error_class, len(data), number, data, item.time_ns)


class PacketReader:
    """Puts a stream of bytes together into packets."""

    def __init__(self) -> None:
        self._greeted = False
        self._rest = b""

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets that ``data`` completes.

        Raises
        ------
        GarbledError : no packets of ours; nothing more can be read of this stream.
        """
        self._rest += data
        if not self._greeted:
            if not HELLO.startswith(self._rest[: len(HELLO)]):
                raise GarbledError(f"expected a tunnel that begins with {HELLO!r}, got {self._rest[:_SHOWN]!r}")
            if len(self._rest) < len(HELLO):
                return []
            self._greeted = True
            self._rest = self._rest[len(HELLO) :]
        packets = []
        at = 0
        while len(self._rest) - at >= _HEADER.size:
            count, sent_ns, ahead_ns, unsent, refused = _HEADER.unpack_from(self._rest, at)
            if count > MAX_RECORDS or sent_ns < 0 or (count and ahead_ns == UNKNOWN):
                raise GarbledError(f"expected a packet of 0 to {MAX_RECORDS} records, got {self._seen(at)}")
            end = at + _HEADER.size + count * _RECORD.size
            if len(self._rest) < end:
                break
            items = [self._item(start) for start in range(at + _HEADER.size, end, _RECORD.size)]
            packets.append(Packet(sent_ns, ahead_ns, unsent, refused, items))
            at = end
        self._rest = self._rest[at:]
        return packets

    def _seen(self, at: int) -> str:
        return repr(self._rest[at : at + _SHOWN])

    def _item(self, at: int) -> Received:
        bus, flagged, length, number, data, time_ns = _RECORD.unpack_from(self._rest, at)
        if bus < len(_BUSES) and length <= 8 and time_ns >= 0:
            name = _BUSES[bus]
            if not flagged & ERROR_FLAG:
                extended = bool(flagged & EXTENDED_FLAG)
                can_id = flagged ^ EXTENDED_FLAG if extended else flagged
                if can_id <= (EXTENDED_MASK if extended else STANDARD_MASK):
                    return Frame(name, can_id, data[:length], time_ns, extended)
            else:
                event = event_of_record(flagged, length, int.from_bytes(number, "big"), data, name, time_ns)
                if event is not None:
                    return event
        raise GarbledError(f"expected a frame or a link event, got {self._seen(at)}")

"""J1939 transport protocol (SAE J1939-21): announced messages of 9 to 1785 bytes, put together from their packets.

A transfer belongs to a channel, a sender and a destination; 0xFF as destination is a broadcast (BAM). Packets may come
out of order or twice, as they do when a receiver asks for some again; the message is there as soon as its last missing
packet is. A transfer ends broken where it is aborted, where a new one begins in its place, and where its packets stay
away longer than the standard allows (by the stamps: 750 ms for a broadcast, 1250 ms otherwise).
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from hil.log.frames import FrameTable
from hil.log.signals.decoded import Rows
from hil.log.signals.lookup import TP_DT, group_number

EVERYBODY = 0xFF
MAX_BYTES = 1785
BROADCAST_TIMEOUT_NS = 750_000_000
TIMEOUT_NS = 1_250_000_000
MAX_TRANSFERS = 4096  # under way at once

_RTS, _CTS, _END, _BAM, _ABORT = 0x10, 0x11, 0x13, 0x20, 0xFF
_PACKET = 7

ABORTED = "aborted"
REPLACED = "a new transfer began before all packets were there"
LATE = "timeout"
MISSING = "packets missing"
TOO_MANY = f"more than {MAX_TRANSFERS} transfers under way"
NO_ANNOUNCEMENT = "announcement that is none (size, number of packets or destination)"
NO_TRANSFER = "packet without an announcement"
NO_PACKET = "packet that is none (number or length)"


class Joined(NamedTuple):
    """A message put together: row of the frame that completed it, and the identifier that it would have."""

    row: int
    channel: int
    can_id: int
    data: bytes


@dataclass(slots=True)
class _Transfer:
    can_id: int  # of the message, priority 6
    size: int
    number: int  # of packets
    last_ns: int
    timeout_ns: int
    packets: dict[int, bytes] = field(default_factory=dict)


def _place(channel: int, source: int, destination: int) -> int:
    """What tells transfers under way apart."""
    return channel << 16 | destination << 8 | source


class Transport:
    """Joins transport frames, table after table.

    Attributes
    ----------
    broken : transfers (and stray packets) that came to nothing since the last `add`, by reason.
    """

    def __init__(self) -> None:
        self.broken: Counter[str] = Counter()
        self._open: dict[int, _Transfer] = {}

    @property
    def open(self) -> int:
        """Number of transfers under way."""
        return len(self._open)

    def add(self, table: FrameTable, rows: Rows, channels: list[int]) -> list[Joined]:
        """Take the transport frames of a table, ``rows`` in the order of the log; return the messages they complete.

        ``channels`` numbers the table's channels among all channels.
        """
        self.broken = Counter()
        joined: list[Joined] = []
        if not len(rows):
            return joined
        channel = table.channel[rows].tolist()
        ids = table.can_id[rows].tolist()
        lengths = table.length[rows].tolist()
        times = table.time_ns[rows].tolist()
        data = np.ascontiguousarray(table.data[rows, :8]).tobytes()
        for i, row in enumerate(rows.tolist()):
            payload = data[8 * i : 8 * i + min(8, lengths[i])]
            can_id = ids[i]
            where = channels[channel[i]]
            if can_id & 0xFF0000 == TP_DT << 8:
                whole = self._packet(where << 16 | can_id & 0xFFFF, payload, times[i])
                if whole is not None:
                    joined.append(Joined(row, channel[i], *whole))
            else:
                self._control(where, can_id & 0xFF, can_id >> 8 & 0xFF, payload, times[i])
        return joined

    def _control(self, channel: int, source: int, destination: int, payload: bytes, now_ns: int) -> None:
        if len(payload) < 8:
            self.broken[NO_ANNOUNCEMENT] += 1
            return
        kind = payload[0]
        if kind in (_RTS, _BAM):
            self._begin(channel, source, destination, payload, now_ns)
            return
        to, fro = _place(channel, destination, source), _place(channel, source, destination)
        group = _group(payload)
        if kind == _CTS:  # the receiver of a transfer speaks
            self._alive(to, now_ns)
        elif kind == _END and self._alive(to, now_ns) is not None:  # the receiver has all packets, the log has not
            self._break(to, MISSING)
        elif kind == _ABORT:  # either of the two
            for place in (to, fro):
                transfer = self._alive(place, now_ns)
                if transfer is not None and group_number(transfer.can_id) == group_number(group << 8):
                    self._break(place, ABORTED)

    def _begin(self, channel: int, source: int, destination: int, payload: bytes, now_ns: int) -> None:
        place = _place(channel, source, destination)
        broadcast = payload[0] == _BAM
        size = payload[1] | payload[2] << 8
        group = _group(payload)
        if self._alive(place, now_ns) is not None:
            self._break(place, REPLACED)
        sound = 8 < size <= MAX_BYTES and payload[3] == -(-size // _PACKET)
        if not sound or broadcast != (destination == EVERYBODY):
            self.broken[NO_ANNOUNCEMENT] += 1
            return
        if len(self._open) >= MAX_TRANSFERS:
            self._break(next(iter(self._open)), TOO_MANY)
        if group >> 8 & 0xFF < 240:
            group = group & 0x3FF00 | destination
        can_id = 6 << 26 | group << 8 | source
        timeout_ns = BROADCAST_TIMEOUT_NS if broadcast else TIMEOUT_NS
        self._open[place] = _Transfer(can_id, size, payload[3], now_ns, timeout_ns)

    def _packet(self, place: int, payload: bytes, now_ns: int) -> tuple[int, bytes] | None:
        transfer = self._alive(place, now_ns)
        if transfer is None:
            self.broken[NO_TRANSFER] += 1
            return None
        number = payload[0] if payload else 0
        held = min(_PACKET, transfer.size - _PACKET * (number - 1))
        if not 1 <= number <= transfer.number or len(payload) < 1 + held:
            self.broken[NO_PACKET] += 1
            return None
        transfer.packets[number] = payload[1 : 1 + held]
        if len(transfer.packets) < transfer.number:
            return None
        del self._open[place]
        return transfer.can_id, b"".join([transfer.packets[i] for i in range(1, transfer.number + 1)])

    def _alive(self, place: int, now_ns: int) -> _Transfer | None:
        """Return the transfer of a place, if there is one and it has not waited too long; it has been heard of now."""
        transfer = self._open.get(place)
        if transfer is None:
            return None
        if now_ns - transfer.last_ns > transfer.timeout_ns:
            self._break(place, LATE)
            return None
        transfer.last_ns = now_ns
        return transfer

    def _break(self, place: int, reason: str) -> None:
        if self._open.pop(place, None) is not None:
            self.broken[reason] += 1


def _group(payload: bytes) -> int:
    """Parameter group that a control frame is about."""
    return payload[5] | payload[6] << 8 | (payload[7] & 3) << 16

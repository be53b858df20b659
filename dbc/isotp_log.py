"""ISO-TP messages in a log: joined by listening alone, with the reason where one is not complete."""

from typing import NamedTuple

from dbc.isotp import N_BS_NS, N_CR_NS, LinkError, PduKind, parse

GAP_NS = N_BS_NS + N_CR_NS
"""Longest pause inside a message: a receiver may let its sender wait once before it has it go on."""


class JoinedMessage(NamedTuple):
    """A message of one identifier; ``start_ns``, ``end_ns``: times of its first and last frame.

    ``length``: as announced; ``error``: why it is not complete (``data`` is what came), None where it is.
    """

    can_id: int
    start_ns: int
    end_ns: int
    length: int
    data: bytes
    error: LinkError | None = None


class _Open(NamedTuple):
    start_ns: int
    end_ns: int
    length: int
    data: bytearray
    number: int


class Reassembler:
    """Joins the frames of any number of identifiers.

    Flow controls and consecutive frames without a first one give nothing. ``gap_ns``: longest pause in a message.
    """

    def __init__(self, gap_ns: int = GAP_NS) -> None:
        self.gap_ns = gap_ns
        self._open: dict[int, _Open] = {}

    def take(self, time_ns: int, can_id: int, data: bytes) -> list[JoinedMessage]:
        """Take one frame (of a log in order of time); return the messages that it completes or shows to be broken."""
        pdu = parse(data)
        if pdu is None or pdu.kind == PduKind.FLOW:
            return []
        ended: list[JoinedMessage] = []
        held = self._open.get(can_id)
        if held is not None and time_ns - held.end_ns > self.gap_ns:
            ended.append(self._close(can_id, LinkError.N_TIMEOUT_CR))
            held = None
        if pdu.kind == PduKind.CONSECUTIVE:
            if held is None:
                return ended
            if pdu.length != held.number:
                return [*ended, self._close(can_id, LinkError.N_WRONG_SN)]
            held.data.extend(pdu.data[: held.length - len(held.data)])
            self._open[can_id] = held._replace(end_ns=time_ns, number=(held.number + 1) & 0xF)
            return [*ended, self._close(can_id, None)] if len(held.data) == held.length else ended
        if held is not None:
            ended.append(self._close(can_id, LinkError.N_UNEXP_PDU))
        if pdu.kind == PduKind.SINGLE:
            return [*ended, JoinedMessage(can_id, time_ns, time_ns, pdu.length, pdu.data)]
        self._open[can_id] = _Open(time_ns, time_ns, pdu.length, bytearray(pdu.data), 1)
        return ended

    def end(self) -> list[JoinedMessage]:
        """Messages that were still open where the log ended, in order of their start."""
        return [
            self._close(i, LinkError.N_TIMEOUT_CR) for i in sorted(self._open, key=lambda i: self._open[i].start_ns)
        ]

    def _close(self, can_id: int, error: LinkError | None) -> JoinedMessage:
        o = self._open.pop(can_id)
        return JoinedMessage(can_id, o.start_ns, o.end_ns, o.length, bytes(o.data), error)

"""ISO-TP (ISO 15765-2): messages of many bytes in CAN and CAN FD frames, normal addressing, time passed in.

`Link` is one end of a connection and takes part in it; `Reassembler` (`dbc.isotp_log`) only listens. The bytes of one
frame become a `Pdu`, or nothing where the standard ignores them.
"""

from enum import Enum, IntEnum
from typing import NamedTuple

from dbc.diagnostic_ids import PADDING
from dbc.frame_length import FD_LENGTHS, fd_length

N_BS_NS = N_CR_NS = 1_000_000_000  # ISO 15765-2: time-outs of a flow control and of a consecutive frame
SHORT_MOST = 4095  # bytes that the 12-bit length of a first frame can tell
LONG_MOST = 0xFFFF_FFFF
_CLASSIC = 8


class PduKind(IntEnum):
    """First half byte of a frame."""

    SINGLE = 0
    FIRST = 1
    CONSECUTIVE = 2
    FLOW = 3


class FlowStatus(IntEnum):
    """What a receiver asks of a sender."""

    CONTINUE = 0
    WAIT = 1
    OVERFLOW = 2


class Pdu(NamedTuple):
    """One frame's content.

    ``length`` of the message (single and first), sequence number (consecutive) or flow status (flow control; any of
    the 16 values); ``data``: the part of the message; ``block_size``, ``st_min``: of a flow control.
    """

    kind: PduKind
    length: int
    data: bytes = b""
    block_size: int = 0
    st_min: int = 0


class LinkError(Enum):
    """Why a message was given up (names of ISO 15765-2)."""

    N_TIMEOUT_BS = "no flow control within N_Bs"
    N_TIMEOUT_CR = "no consecutive frame within N_Cr"
    N_WRONG_SN = "consecutive frame with a wrong sequence number"
    N_INVALID_FS = "flow control with a reserved flow status"
    N_UNEXP_PDU = "a new message began before the last had ended"
    N_WFT_OVRN = "too many flow controls that ask to wait"
    N_BUFFER_OVFLW = "message longer than the receiver takes"


def parse(data: bytes) -> Pdu | None:
    """Content of one frame's data bytes; None where it is none, or one that the standard has ignored."""
    if not data:
        return None
    kind, low, size = data[0] >> 4, data[0] & 0xF, len(data)
    if kind == PduKind.SINGLE:
        start = 1
        if size > _CLASSIC:  # length in the second byte
            if low:
                return None
            low, start = data[1], 2
        return Pdu(PduKind.SINGLE, low, data[start : start + low]) if 0 < low <= size - start else None
    if kind == PduKind.FIRST:
        if size < _CLASSIC:
            return None
        length, start = low << 8 | data[1], 2
        if length == 0:
            length, start = int.from_bytes(data[2:6], "big"), 6
            if length <= SHORT_MOST:
                return None
        # what fits in a single frame is none
        return Pdu(PduKind.FIRST, length, data[start:]) if length > single_most(size) else None
    if kind == PduKind.CONSECUTIVE:
        return Pdu(PduKind.CONSECUTIVE, low, data[1:]) if size > 1 else None
    if kind == PduKind.FLOW and size >= 3:
        return Pdu(PduKind.FLOW, low, b"", data[1], data[2])
    return None


def single_most(frame_bytes: int) -> int:
    """Bytes of a message that a single frame of ``frame_bytes`` takes."""
    return frame_bytes - 1 if frame_bytes <= _CLASSIC else frame_bytes - 2


def st_min_ns(byte: int) -> int:
    """Least time between two consecutive frames that a flow control asks for; reserved values mean 127 ms."""
    if byte <= 0x7F:
        return byte * 1_000_000
    if 0xF1 <= byte <= 0xF9:
        return (byte - 0xF0) * 100_000
    return 127_000_000


def flow_control(status: FlowStatus, block_size: int = 0, st_min: int = 0) -> bytes:
    """Data bytes of a flow control; ``st_min`` as on the wire."""
    return bytes((PduKind.FLOW << 4 | status, block_size, st_min))


def segment(message: bytes, frame_bytes: int = _CLASSIC, padding: int | None = None) -> list[bytes]:
    """Data bytes of all frames of a message: one single frame, or a first frame and consecutive ones.

    Parameters
    ----------
    message : 1 byte to 2^32 - 1.
    frame_bytes : most data bytes of a frame, 8 or a length of CAN FD.
    padding : byte that fills frames up to 8 bytes; None where they may be shorter. Lengths that CAN FD does not have
        are always filled (0xCC where None).
    """
    if frame_bytes not in FD_LENGTHS or frame_bytes < _CLASSIC:
        raise ValueError(f"frames of {frame_bytes} bytes; expected 8 or one of {FD_LENGTHS[9:]}")
    n = len(message)
    if not 0 < n <= LONG_MOST:
        raise ValueError(f"a message of {n} bytes; ISO-TP takes 1 to {LONG_MOST}")
    if n <= single_most(_CLASSIC):
        return [_filled(bytes((n,)) + message, padding)]
    if n <= single_most(frame_bytes):
        return [_filled(bytes((0, n)) + message, padding)]
    head = bytes((PduKind.FIRST << 4 | n >> 8, n & 0xFF)) if n <= SHORT_MOST else b"\x10\x00" + n.to_bytes(4, "big")
    at = frame_bytes - len(head)
    frames = [head + message[:at]]
    number = 1
    while at < n:
        part = message[at : at + frame_bytes - 1]
        frames.append(_filled(bytes((PduKind.CONSECUTIVE << 4 | number,)) + part, padding))
        at, number = at + len(part), (number + 1) & 0xF
    return frames


def _filled(data: bytes, padding: int | None) -> bytes:
    size = _CLASSIC if padding is not None and len(data) < _CLASSIC else fd_length(len(data))
    return data.ljust(size, bytes((PADDING if padding is None else padding,)))


class _Sending(NamedTuple):
    """A segmented message on its way: ``left`` frames; the next ``block`` of them (None: all) from ``due_ns`` on."""

    left: list[bytes]
    flow_until_ns: int | None  # waits for a flow control until then
    waits: int
    block: int | None
    gap_ns: int
    due_ns: int


class _Receiving(NamedTuple):
    length: int
    data: bytearray
    number: int
    frame_bytes: int
    block_left: int
    until_ns: int


class Link:
    """One end of an ISO-TP connection: one identifier each way, both directions at once.

    Parameters
    ----------
    frame_bytes : most data bytes of the frames sent.  padding : see `segment`.
    block_size, st_min : what its own flow controls ask for, as on the wire.
    most_bytes : longest message taken; a longer one is answered with overflow.
    most_waits : flow controls in a row that may ask to wait.
    burst : most frames that one call of `frames` gives (queues of adapters are short).

    Attributes
    ----------
    errors : why messages were given up since the last look, who looks may clear it.
    flow : block size and STmin byte of the last flow control that the other end sent, None before.
    """

    def __init__(
        self, *, frame_bytes: int = _CLASSIC, padding: int | None = None, block_size: int = 0, st_min: int = 0,
        most_bytes: int = SHORT_MOST, most_waits: int = 10, burst: int = 64,
    ) -> None:  # fmt: skip
        self.frame_bytes, self.padding = frame_bytes, padding
        self.block_size, self.st_min = block_size, st_min
        self.most_bytes, self.most_waits, self.burst = most_bytes, most_waits, burst
        self.errors: list[LinkError] = []
        self.flow: tuple[int, int] | None = None
        self._out: list[bytes] = []
        self._flows: list[bytes] = []
        self._sending: _Sending | None = None
        self._receiving: _Receiving | None = None

    @property
    def sending(self) -> bool:
        """A message is on its way."""
        return self._sending is not None or bool(self._out)

    @property
    def receiving(self) -> bool:
        """A segmented message has begun and not ended."""
        return self._receiving is not None

    def send(self, now_ns: int, message: bytes) -> None:
        """Begin to send a message; RuntimeError while another is on its way."""
        if self.sending:
            raise RuntimeError("a message is still being sent; look at `sending` first")
        first, *left = segment(message, self.frame_bytes, self.padding)
        self._out.append(first)
        if left:
            self._sending = _Sending(left, now_ns + N_BS_NS, 0, None, 0, now_ns)

    def take(self, now_ns: int, data: bytes) -> bytes | None:
        """Take the data bytes of one received frame; return the message that it completes."""
        self._expire(now_ns)
        pdu = parse(data)
        if pdu is None:
            return None
        if pdu.kind == PduKind.FLOW:
            self._take_flow(now_ns, pdu)
            return None
        if pdu.kind == PduKind.CONSECUTIVE:
            return self._take_consecutive(now_ns, pdu, len(data))
        if self._receiving is not None:
            self._give_up_receiving(LinkError.N_UNEXP_PDU)
        if pdu.kind == PduKind.SINGLE:
            return pdu.data
        if pdu.length > self.most_bytes:
            self.errors.append(LinkError.N_BUFFER_OVFLW)
            self._flow(FlowStatus.OVERFLOW)
            return None
        self._receiving = _Receiving(pdu.length, bytearray(pdu.data), 1, len(data), self.block_size, now_ns + N_CR_NS)
        self._flow(FlowStatus.CONTINUE)
        return None

    def frames(self, now_ns: int) -> list[bytes]:
        """Data bytes of the frames that are due."""
        self._expire(now_ns)
        out = [*self._flows, *self._out]
        self._flows, self._out = [], []
        s = self._sending
        while s is not None and s.flow_until_ns is None and s.due_ns <= now_ns and len(out) < self.burst:
            out.append(s.left.pop(0))
            if not s.left:
                s = None
            elif s.block == 1:
                s = s._replace(flow_until_ns=now_ns + N_BS_NS, waits=0)
            else:
                s = s._replace(block=None if s.block is None else s.block - 1, due_ns=now_ns + s.gap_ns)
            self._sending = s
        return out

    def _expire(self, now_ns: int) -> None:
        s, r = self._sending, self._receiving
        if s is not None and s.flow_until_ns is not None and now_ns > s.flow_until_ns:
            self._give_up_sending(LinkError.N_TIMEOUT_BS)
        if r is not None and now_ns > r.until_ns:
            self._give_up_receiving(LinkError.N_TIMEOUT_CR)

    def _take_flow(self, now_ns: int, pdu: Pdu) -> None:
        s = self._sending
        if s is None or s.flow_until_ns is None or self._out:
            return  # nobody asked
        if pdu.length == FlowStatus.CONTINUE:
            self.flow = pdu.block_size, pdu.st_min
            self._sending = _Sending(s.left, None, 0, pdu.block_size or None, st_min_ns(pdu.st_min), now_ns)
        elif pdu.length == FlowStatus.WAIT:
            if s.waits >= self.most_waits:
                self._give_up_sending(LinkError.N_WFT_OVRN)
            else:
                self._sending = s._replace(waits=s.waits + 1, flow_until_ns=now_ns + N_BS_NS)
        else:
            overflow = pdu.length == FlowStatus.OVERFLOW
            self._give_up_sending(LinkError.N_BUFFER_OVFLW if overflow else LinkError.N_INVALID_FS)

    def _take_consecutive(self, now_ns: int, pdu: Pdu, size: int) -> bytes | None:
        r = self._receiving
        if r is None:
            return None
        missing = r.length - len(r.data)
        if size < min(r.frame_bytes, missing + 1):
            return None  # shorter than it has to be: ignored
        if pdu.length != r.number:
            self._give_up_receiving(LinkError.N_WRONG_SN)
            return None
        r.data.extend(pdu.data[:missing])
        if len(r.data) == r.length:
            self._receiving = None
            return bytes(r.data)
        block_left = r.block_left - 1 if r.block_left else 0
        if self.block_size and not block_left:
            block_left = self.block_size
            self._flow(FlowStatus.CONTINUE)
        self._receiving = r._replace(number=(r.number + 1) & 0xF, block_left=block_left, until_ns=now_ns + N_CR_NS)
        return None

    def _flow(self, status: FlowStatus) -> None:
        data = flow_control(status, self.block_size, self.st_min)
        self._flows.append(_filled(data, self.padding))

    def _give_up_sending(self, error: LinkError) -> None:
        self._sending = None
        self.errors.append(error)

    def _give_up_receiving(self, error: LinkError) -> None:
        self._receiving = None
        self.errors.append(error)

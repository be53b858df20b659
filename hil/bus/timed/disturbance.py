"""What can go wrong with one frame on the wire: where it breaks off, and who saw it first."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

from hil.bus.timed.controller import Controller
from hil.bus.timed.noise import BitErrors
from hil.bus.timed.wire import WireFrame, stuffed_part

WRONG_RATE_BITS = 19  # a node at another bit rate has misread the frame by the end of its length code
_BEHIND_ACKNOWLEDGE = 8  # delimiter of the acknowledge and end of frame
_RUN_OF_AN_ERROR = 6  # equal bits that no frame has


class Seen(Enum):
    """Who sees an error first."""

    BY_SENDER = auto()  # and, by its flag, by all others
    BY_RECEIVERS = auto()  # those named; the sender and the others by their flag
    ACKNOWLEDGE = auto()  # the sender, as nobody acknowledged
    LAST_BIT = auto()  # the sender alone, when the receivers have taken the frame


@dataclass(slots=True)
class Disturbance:
    """An error of a frame.

    Attributes
    ----------
    bit : index of the bit at which it is seen.
    seen : who sees it first.
    first : receivers that do, of ``BY_RECEIVERS``.
    counts : whether the senders count it (two exceptions of ISO 11898-1 do not).
    senders_receive : the senders have lost arbitration to a wrong bit, and count as receivers.
    """

    bit: int
    seen: Seen
    first: list[Controller] = field(default_factory=list)
    counts: bool = True
    senders_receive: bool = False


def wrong_bit(frame: WireFrame, bit: int, bits: int) -> Disturbance:
    """A bit on the wire that everybody reads wrong.

    Parameters
    ----------
    bit, bits : its index, and the bits of the frame up to the end of the end-of-frame field.
    """
    if bit == bits - 1:
        return Disturbance(bit, Seen.LAST_BIT)
    if bit == bits - 1 - _BEHIND_ACKNOWLEDGE:
        return Disturbance(bit, Seen.ACKNOWLEDGE)
    stuffed = stuffed_part(frame)
    if bit < _arbitration_bits(frame, stuffed) and stuffed[bit][0] == 1:  # recessive, read as dominant
        if stuffed[bit][1]:
            return Disturbance(bit, Seen.BY_SENDER, counts=False)
        return Disturbance(bit + _RUN_OF_AN_ERROR, Seen.BY_SENDER, counts=False, senders_receive=True)
    return Disturbance(bit, Seen.BY_SENDER)


def _arbitration_bits(frame: WireFrame, stuffed: Sequence[tuple[int, bool]]) -> int:
    """Bits from start of frame to the end of the arbitration field, stuff bits included."""
    plain = 33 if frame.extended else 13
    for index, (_, stuff_bit) in enumerate(stuffed):
        plain -= not stuff_bit
        if not plain:
            return index + 1
    raise AssertionError("a frame is longer than its arbitration field")


def first_difference(one: WireFrame, other: WireFrame) -> tuple[int, bool] | None:
    """Index of the first bit in which two frames differ, and whether ``one`` is dominant there; None where none."""
    for index, (mine, theirs) in enumerate(zip(stuffed_part(one), stuffed_part(other), strict=False)):
        if mine[0] != theirs[0]:
            return index, mine[0] == 0
    return None


def missed_by(receivers: Sequence[Controller], bits: int) -> tuple[Disturbance | None, list[Controller]]:
    """Receivers with a noise of their own that read a bit wrong.

    Returns
    -------
    The error of those that flag it, at its first bit; and those that miss the frame without a flag that all could see.
    """
    silent: list[Controller] = []
    error: Disturbance | None = None
    for receiver in receivers:
        bit = receiver.noise.within(bits - 1) if receiver.noise.rate else None  # the last bit is none of its business
        if bit is None:
            continue
        if not receiver.flags:
            silent.append(receiver)
        elif error is None or bit < error.bit:
            error = Disturbance(bit, Seen.BY_RECEIVERS, [receiver])
    return error, silent


def earliest(errors: Sequence[Disturbance | None]) -> Disturbance | None:
    """The error that breaks the frame off."""
    return min((error for error in errors if error is not None), key=lambda error: error.bit, default=None)


def sender_noise(noise: BitErrors, senders: Sequence[Controller], frame: WireFrame, bits: int) -> Disturbance | None:
    """Errors of the wire, and of the sender's own reading."""
    sources = [noise, *[sender.noise for sender in senders]]
    wrong = [bit for bit in (source.within(bits) for source in sources if source.rate) if bit is not None]
    return wrong_bit(frame, min(wrong), bits) if wrong else None

"""Load and worst-case responses of the messages of a database."""

from dataclasses import dataclass

from dbc.database_values import Database, Message
from dbc.frame_length import fd_length
from hil.bus.timed.frame_length import most_bits
from hil.bus.timed.response_time import Response, Stream, utilisation, worst_case
from hil.bus.timed.wire import WireFrame, arbitration_key


@dataclass(frozen=True, slots=True)
class AnalysedMessage:
    """A message with a cycle time, and its worst case.

    Attributes
    ----------
    frame : of its identifier and length; what the data are does not matter.
    transmission_ns : longest time on the bus, pause included.
    period_ns : its cycle time, which is its deadline too: the next frame overtakes the data of one that comes later.
    response : worst case, from the event to the end of the frame.
    """

    message: Message
    frame: WireFrame
    transmission_ns: int
    period_ns: int
    response: Response

    @property
    def missed(self) -> bool:
        """No bound, or one beyond the deadline."""
        return self.response.response_ns is None or self.response.response_ns > self.period_ns


@dataclass(frozen=True, slots=True)
class BusAnalysis:
    """What a bus has to carry, by priority.

    Attributes
    ----------
    load : share of the time that frames of messages with a cycle time take, each of the greatest length.
    messages : those with a cycle time, the most urgent first.
    left_out : all others, with the reason.
    """

    load: float
    messages: tuple[AnalysedMessage, ...]
    left_out: tuple[tuple[Message, str], ...]

    @property
    def missed(self) -> int:
        """Messages whose deadline is not met in the worst case."""
        return sum(one.missed for one in self.messages)


def analyse(database: Database, bit_rate: int, data_bit_rate: int | None = None, jitter_ns: int = 0) -> BusAnalysis:
    """Bound the responses of all messages of one bus.

    Parameters
    ----------
    bit_rate : nominal, bit/s.
    data_bit_rate : CAN FD frames switch to it, bit/s; None: they do not switch.
    jitter_ns : queueing jitter of every message: how much later than its period asks a node may queue it.

    Returns
    -------
    Every message of the database is either bounded or left out. One without a cycle time blocks those before it.
    """
    left_out: list[tuple[Message, str]] = []
    ranked: list[tuple[Message, WireFrame]] = []
    for message in database.messages.values():
        frame = _frame(message, data_bit_rate is not None)
        if isinstance(frame, str):
            left_out.append((message, frame))
        else:
            ranked.append((message, frame))
    ranked.sort(key=lambda one: arbitration_key(one[1]))
    streams = [
        Stream(most_bits(frame).duration_ns(bit_rate, data_bit_rate), _period_ns(message), jitter_ns)
        for message, frame in ranked
    ]
    bit_ns = -(-1_000_000_000 // bit_rate)
    messages = []
    for index, ((message, frame), stream) in enumerate(zip(ranked, streams, strict=True)):
        if stream.period_ns is None:
            left_out.append((message, "no cycle time; it only blocks others"))
            continue
        response = worst_case(streams, index, bit_ns)
        messages.append(AnalysedMessage(message, frame, stream.transmission_ns, stream.period_ns, response))
    return BusAnalysis(utilisation(streams), tuple(messages), tuple(left_out))


def _period_ns(message: Message) -> int | None:
    return round(message.cycle_time_ms * 1e6) or None if message.cycle_time_ms else None


def _frame(message: Message, switched: bool) -> WireFrame | str:
    """A frame as long as the message's, or why there is none."""
    most = 64 if message.is_fd else 8
    if message.length > most:
        kind = "a CAN FD frame carries" if message.is_fd else "not stated to be CAN FD, and a classical frame carries"
        return f"{message.length} bytes; {kind} at most {most} (a transport protocol sends it in several)"
    length = fd_length(message.length) if message.is_fd else message.length
    switch = message.is_fd and switched
    return WireFrame(message.can_id, bytes(length), message.extended, fd=message.is_fd, bit_rate_switch=switch)

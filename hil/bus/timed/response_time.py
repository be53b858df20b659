"""Worst-case response times of the messages of a CAN bus.

Davis, Burns, Bril, Lukkien: Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised.
Real-Time Systems 35 (2007), 239-272. Symbols as there: C transmission time, T period, J queueing jitter, B blocking,
w(q) queueing delay of instance q of a busy period, R response time, tau_bit time of a bit. All in ns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

MOST_INSTANCES = 10_000  # of a busy period; a bus so close to full is told as one without a bound


@dataclass(frozen=True, slots=True)
class Stream:
    """A message as the analysis takes it; the order of a sequence of them is their priority.

    Attributes
    ----------
    transmission_ns : C, the longest, pause of three bits included.
    period_ns : T, the shortest time between two; None where nothing bounds it: it blocks, and is not looked at further.
    jitter_ns : J, between the event and the frame in the queue.
    """

    transmission_ns: int
    period_ns: int | None
    jitter_ns: int = 0


@dataclass(frozen=True, slots=True)
class Response:
    """The worst case of a message.

    Attributes
    ----------
    response_ns : R, from the event to the end of the frame and its pause; None without a bound.
    blocking_ns : B, the longest frame of less priority, which may have just begun.
    instance : which instance of the busy period has it, from 0.
    instances : how many the busy period has.
    """

    response_ns: int | None
    blocking_ns: int
    instance: int = 0
    instances: int = 0


def utilisation(streams: Sequence[Stream]) -> float:
    """Share of the time that the bus is taken."""
    return sum(s.transmission_ns / s.period_ns for s in streams if s.period_ns is not None)


def worst_case(streams: Sequence[Stream], index: int, bit_ns: int) -> Response:
    """Worst-case response time of one of the messages, over all instances of its busy period (equations 4 to 10).

    Parameters
    ----------
    streams : of the whole bus, the most urgent first.
    index : which of them; one with a period.
    bit_ns : tau_bit.

    Raises
    ------
    ValueError
        For a message without a period.
    """
    stream = streams[index]
    if stream.period_ns is None:
        raise ValueError(f"message {index} has no period, so no response time can be bounded")
    blocking = max((s.transmission_ns for s in streams[index + 1 :]), default=0)
    more_urgent = [(s.period_ns, s.jitter_ns, s.transmission_ns) for s in streams[:index] if s.period_ns is not None]
    C, T, J = stream.transmission_ns, stream.period_ns, stream.jitter_ns
    share = utilisation(streams[: index + 1])
    if share >= 1.0:
        return Response(None, blocking)
    busy = max(blocking + C, int(blocking / (1.0 - share) * (1.0 - 1e-9)))  # no busy period is shorter
    while True:
        longer = blocking + -(-(busy + J) // T) * C + sum(-(-(busy + j) // t) * c for t, j, c in more_urgent)
        if longer == busy:
            break
        busy = longer
        if busy > MOST_INSTANCES * T:
            return Response(None, blocking)
    instances = -(-(busy + J) // T)
    w, worst, at = blocking, 0, 0
    for q in range(instances):
        w = max(w, blocking + q * C)
        while True:
            longer = blocking + q * C + sum(-(-(w + j + bit_ns) // t) * c for t, j, c in more_urgent)
            if longer <= w:
                break
            w = longer
        response = J + w - q * T + C
        if response > worst:
            worst, at = response, q
    return Response(worst, blocking, at, instances)

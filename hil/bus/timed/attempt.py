"""One frame on the wire: who sends it, who gets it, and what an error of it costs each of them."""

from dataclasses import dataclass

from dbc.frame import LinkState
from hil.bus.timed import disturbance
from hil.bus.timed.controller import Controller, Reception
from hil.bus.timed.disturbance import Disturbance, Seen
from hil.bus.timed.transmit_queue import Request
from hil.bus.timed.wire import WireFrame


@dataclass(slots=True)
class Attempt:
    """A frame on the wire, and how it will end."""

    frame: WireFrame
    requests: list[tuple[Controller, Request]]
    receivers: list[Controller]
    start_ns: int
    end_ns: int
    free_ns: int
    recessive_from_ns: int
    error: Disturbance | None = None
    missing: tuple[Controller, ...] = ()  # receivers that read it wrong and flagged nothing that others could see
    losing: tuple[Controller, ...] = ()  # error-passive senders of the same identifier with other data


def fail(attempt: Attempt, error: Disturbance) -> None:
    """Count an error where the standard has each controller count it, and try again (the requests still wait)."""
    end_ns = attempt.end_ns
    senders = [c for c, _ in attempt.requests]
    if error.seen is Seen.LAST_BIT:
        reception = Reception(attempt.frame, end_ns)
        for controller in attempt.receivers:
            if controller not in attempt.missing:
                controller.take(reception)
    else:
        others = any(c.flags for c in (*senders, *attempt.receivers) if c not in error.first)
        for controller in attempt.receivers:
            controller.counters.receive_error(first=controller in error.first and others)
    for controller in (*senders, *attempt.losing):
        if error.senders_receive:
            controller.counters.receive_error()
        elif error.counts and not (error.seen is Seen.ACKNOWLEDGE and _exempt(controller, attempt.receivers)):
            controller.counters.transmit_error()
        if error.seen is Seen.ACKNOWLEDGE:
            controller.unacknowledged(end_ns)
    for controller in (*senders, *attempt.losing, *attempt.receivers):
        controller.follow(end_ns)


def _exempt(sender: Controller, receivers: list[Controller]) -> bool:
    """An error-passive sender that sees no dominant bit while it flags a missing acknowledge does not count it."""
    return sender.state is LinkState.ERROR_PASSIVE and not any(c.flags for c in receivers)


def collision(
    requests: list[tuple[Controller, Request]],
) -> tuple[list[tuple[Controller, Request]], list[Controller], Disturbance | None]:
    """Several controllers send the same identifier: equal frames are one frame, others meet a bit error.

    Returns
    -------
    Who sends on; error-passive controllers that drop out unseen; the error that all see, None where there is none.
    """
    best = requests[0]
    for other in requests[1:]:
        difference = disturbance.first_difference(best[1].frame, other[1].frame)
        if difference is not None and not difference[1]:
            best = other
    differing = [
        (difference[0], c)
        for c, request in requests
        if (difference := disturbance.first_difference(best[1].frame, request.frame)) is not None
    ]
    active = [bit for bit, c in differing if c.flags]
    if active:
        return requests, [], Disturbance(min(active), Seen.BY_SENDER)
    dropped = [c for _, c in differing]
    return [(c, request) for c, request in requests if c not in dropped], dropped, None

"""Frames that wait in a controller, by priority or in order of asking."""

import heapq
from itertools import count
from typing import NamedTuple

from hil.bus.timed.wire import WireFrame, arbitration_key


class Request(NamedTuple):
    """A frame that waits: its rank in this queue, and when it was asked for."""

    rank: int
    number: int
    key: int
    frame: WireFrame
    queued_ns: int


class TransmitQueue:
    """The frame that the controller offers to arbitration is the head.

    Parameters
    ----------
    fifo : in order of asking, as a network interface of Linux; else by priority, equal identifiers in order.
    length : how many wait at most.

    Attributes
    ----------
    waiting : requests, a heap by rank.
    since_ns : since when there has been a head.
    """

    def __init__(self, fifo: bool, length: int) -> None:
        self.fifo = fifo
        self.length = length
        self.since_ns = 0
        self.waiting: list[Request] = []
        self._numbers = count()

    def push(self, frame: WireFrame, now_ns: int) -> bool:
        """Take a frame; False where the queue is full."""
        if len(self.waiting) >= self.length:
            return False
        if not self.waiting:
            self.since_ns = now_ns
        key = arbitration_key(frame)
        heapq.heappush(self.waiting, Request(0 if self.fifo else key, next(self._numbers), key, frame, now_ns))
        return True

    @property
    def head(self) -> Request:
        """The frame to send next."""
        return self.waiting[0]

    def remove(self, request: Request) -> None:
        """Drop a request that has been sent; more urgent ones may have come before it meanwhile."""
        if self.waiting[0] is request:
            heapq.heappop(self.waiting)
        else:
            self.waiting.remove(request)
            heapq.heapify(self.waiting)

    def clear(self) -> int:
        """Drop all; how many that were."""
        dropped, self.waiting = len(self.waiting), []
        return dropped

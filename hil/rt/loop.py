"""A fixed rate on absolute deadlines, and a node run by it.

    deadline(k) = epoch + phase + k * period,      k = 0, 1, 2, ...

The epoch is the next multiple of 100 ms of the clock, so the loops of separately started processes of one machine keep
a defined relative phase (for periods that divide 100 ms). A node is told ``deadline - epoch``: the same numbers in real
and in virtual time, whenever it was started and however late it woke.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from dbc.frame import Frame, Node, Received
from hil.rt.clock import Clock

GRID_NS = 100_000_000
"""Epochs are multiples of this, ns."""


class Tick(NamedTuple):
    """One turn of a loop.

    Attributes
    ----------
    number : k of the deadline that is served; it jumps where ticks were skipped.
    now_ns : nominal time since the epoch, ``phase + number * period``.
    lateness_ns : time of waking after the first deadline not served yet; beyond a period where ticks were skipped.
    skipped : deadlines missed for good just before this one, each an overrun.
    """

    number: int
    now_ns: int
    lateness_ns: int
    skipped: int


class Loop:
    """Ticks at a fixed rate: no drift, no burst after a late one.

    Parameters
    ----------
    clock : where time comes from.
    period_ns, phase_ns : of the deadlines, ns; the phase is at least 0.
    """

    def __init__(self, clock: Clock, period_ns: int, phase_ns: int = 0) -> None:
        if period_ns <= 0 or phase_ns < 0:
            raise ValueError(f"loop: expected period > 0 and phase >= 0, got {period_ns} ns and {phase_ns} ns")
        self._clock = clock
        self._period_ns = period_ns
        self._phase_ns = phase_ns
        self.overruns = 0
        """Ticks skipped so far."""

    def ticks(self) -> Iterator[Tick]:
        """Yield one tick per deadline, for ever; what the caller does between two of them is the tick's work."""
        clock, period_ns = self._clock, self._period_ns
        epoch_ns = -(-clock.now_ns() // GRID_NS) * GRID_NS
        first_ns = epoch_ns + self._phase_ns
        index = 0
        while True:
            due_ns = first_ns + index * period_ns
            clock.sleep_until(due_ns)
            lateness_ns = max(0, clock.now_ns() - due_ns)
            skipped = lateness_ns // period_ns
            index += skipped
            self.overruns += skipped
            yield Tick(index, self._phase_ns + index * period_ns, lateness_ns, skipped)
            index += 1


class Port(Protocol):
    """What joins a node to its buses."""

    def receive(self) -> list[Received]:
        """Return what arrived since the last call, without waiting."""
        ...

    def send(self, frames: Sequence[Frame]) -> None:
        """Send the frames of one tick."""
        ...


def run_node(node: Node, port: Port, loop: Loop) -> Iterator[Tick]:
    """Run ``node`` once per tick, and hand each tick to the caller after its frames were sent.

    The caller ends the run by leaving the iteration; in between it may publish the tick's health or stop for a signal.
    """
    for tick in loop.ticks():
        port.send(node.step(tick.now_ns, port.receive()))
        yield tick

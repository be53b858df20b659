"""The bus protocol, and how a bus is named.

A bus is named ``KIND:CHANNEL[,OPTION=VALUE...]``: ``loopback:demo``, ``socketcan:vcan0``,
``kvaser:0,bitrate=250000``. A kind that is not ours is python-can's interface of that name, its options go to it.
"""

import select
from collections.abc import Sequence
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from dbc.frame import Frame, Received
from hil.errors import BrakebenchError

Option = str | int | float | bool


class BusError(BrakebenchError):
    """A bus cannot be opened or is taken."""


class Bus(Protocol):
    """A member's access to one bus. One reader per bus: not to be read from two threads."""

    @property
    def name(self) -> str:
        """Kind and channel, as given to `open_bus`."""
        ...

    def send(self, frames: Sequence[Frame]) -> None:
        """Send frames in order, without waiting.

        What the bus does not take is dropped and reported as a ``TX_OVERFLOW`` or ``DISCONNECTED`` event, never raised.

        Raises
        ------
        ValueError : a frame that no classical CAN bus can carry, or of the other bus.
        """
        ...

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is, in order; wait up to ``timeout_s`` for the first."""
        ...

    def fileno(self) -> int:
        """Return what `select` can wait on, or -1 where the driver has no such thing (see `wait`)."""
        ...

    def close(self) -> None:
        """Leave the bus; closing twice is harmless."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


OWN_KINDS = ("loopback", "socketcan")
"""Kinds of bus of our own (`hil.bus.open`); any other is left to python-can."""


JOINABLE = frozenset({"loopback", "socketcan", "socketcand", "virtual", "udp_multicast", "brakebench"})
"""Kinds of bus that any number of processes joins as it is; any other has one owner."""


class BusSpec(NamedTuple):
    """A bus by name: ``kind:channel`` and the driver's options."""

    kind: str
    channel: str
    options: dict[str, Option]

    @property
    def name(self) -> str:
        """Kind and channel without the options."""
        return f"{self.kind}:{self.channel}"


def parse_spec(spec: str) -> BusSpec:
    """Parse ``KIND:CHANNEL[,OPTION=VALUE...]``.

    Raises
    ------
    BusError : not of that form.
    """
    name, *pairs = spec.split(",")
    kind, _, channel = name.partition(":")
    options: dict[str, Option] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not (key.isidentifier() and equals and value):
            raise BusError(f"bus {spec!r}: option {pair!r} is not KEY=VALUE, such as bitrate=500000")
        options[key] = _option(value)
    if not kind.isidentifier() or not channel:
        raise BusError(f"bus {spec!r}: expected KIND:CHANNEL, such as loopback:demo, socketcan:vcan0 or kvaser:0")
    return BusSpec(kind, channel, options)


def _option(text: str) -> Option:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def wait(buses: Sequence[Bus], timeout_s: float) -> None:
    """Return as soon as one of ``buses`` may have something to receive, or after ``timeout_s``.

    Buses without a file descriptor are not waited for but polled: the wait then ends after at most 1 ms.
    """
    files = [bus.fileno() for bus in buses]
    if -1 in files:
        timeout_s = min(timeout_s, 0.001)
    poll = select.poll()
    for file in files:
        if file != -1:
            poll.register(file, select.POLLIN)
    poll.poll(max(0.0, timeout_s) * 1e3)

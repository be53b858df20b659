"""Who may send where: a bus with hardware is only listened to until somebody says that it may be sent to."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from dbc.frame import BusName, Frame, Received
from hil.bus.bus import Bus, BusError, parse_spec
from hil.bus.can_frame import pack_frame
from hil.bus.channel import resolve
from hil.bus.open import open_bus
from hil.bus.python_can_driver import LISTEN_ONLY

_WITHOUT_HARDWARE = ("loopback", "timed", "virtual", "brakebench")  # nothing of these leaves the machine
_VIRTUAL_LINKS = ("vcan", "vxcan")


def has_hardware(spec: str) -> bool:
    """Whether somebody real may be on a bus: on any but loopback, timed, vcan, vxcan and python-can's ``virtual``.

    An interface counts as virtual by its name, where no device stands behind it.
    """
    parsed = parse_spec(resolve(spec))
    if parsed.kind != "socketcan":
        return parsed.kind not in _WITHOUT_HARDWARE
    device = Path("/sys/class/net") / parsed.channel / "device"
    return not parsed.channel.startswith(_VIRTUAL_LINKS) or device.exists()


def check_transmit(spec: str, transmit: bool, why: str) -> None:
    """Refuse a bus with hardware unless told to send.

    Parameters
    ----------
    why : what is sent there, for people: ``diag sends requests``.

    Raises
    ------
    BusError : it says what to add.
    """
    if has_hardware(spec) and not transmit:
        raise BusError(
            f"bus {parse_spec(resolve(spec)).name}: {why}, and on real hardware that reaches a real ECU or a real "
            "brake; add --transmit where that is meant"
        )


def open_for_role(spec: str, bus: BusName, transmit: bool, *, optional: bool = True) -> "Bus | ListeningBus":
    """Join a bus; one with hardware is only listened to unless ``transmit``.

    ``optional`` False: the command never sends, and has no ``--transmit``.

    Raises
    ------
    BusError : as of `open_bus`; or ``transmit`` with the option ``listen_only``.
    """
    spec = resolve(spec)
    parsed = parse_spec(spec)
    silent = parsed.options.get("listen_only") is True
    if transmit and silent:
        raise BusError(f"bus {parsed.name}: --transmit and listen_only=true contradict each other; leave out one")
    if transmit or not (silent or has_hardware(spec)):
        return open_bus(spec, bus)
    if parsed.kind in LISTEN_ONLY and not silent:
        spec += ",listen_only=true"
    return ListeningBus(open_bus(spec, bus), optional)


class ListeningBus:
    """A bus to which nothing is sent.

    Attributes
    ----------
    withheld : frames that would have been sent.
    words : what that means on this bus, for people.
    """

    def __init__(self, bus: Bus, optional: bool = True) -> None:
        self._bus = bus
        self.name = bus.name
        self.withheld = 0
        kind, _, channel = bus.name.partition(":")
        self.words = f"listens only: nothing is sent on {bus.name}{' without --transmit' if optional else ''}; "
        if kind in LISTEN_ONLY:
            self.words += "the adapter does not acknowledge either"
        elif kind == "socketcan":
            self.words += (
                "the link still acknowledges what it hears, unless it is told: "
                f"sudo ip link set {channel} type can listen-only on"
            )
        else:
            self.words += f"an adapter of {kind} may still acknowledge what it hears"

    def send(self, frames: Sequence[Frame]) -> None:
        """Count the frames; ValueError where a bus would refuse them."""
        for frame in frames:
            pack_frame(frame, frame.bus)
        self.withheld += len(frames)

    def receive(self, timeout_s: float = 0.0) -> list[Received]:
        """Return everything there is, in order; wait up to ``timeout_s`` for the first."""
        return self._bus.receive(timeout_s)

    def fileno(self) -> int:
        """Return what `select` can wait on, or -1."""
        return self._bus.fileno()

    def close(self) -> None:
        """Leave the bus."""
        self._bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

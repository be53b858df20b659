"""Opens a bus by its name."""

from collections.abc import Callable

from dbc.frame import BusName
from hil.bus.bus import OWN_KINDS, Bus, BusError, BusSpec, parse_spec
from hil.bus.channel import resolve


def _open_loopback(spec: BusSpec, bus: BusName) -> Bus:
    from hil.bus.loopback import LoopbackBus

    if spec.options:
        raise BusError(f"bus {spec.name}: a loopback has no options, got {', '.join(spec.options)}")
    return LoopbackBus(spec.channel, bus)


def _open_socketcan(spec: BusSpec, bus: BusName) -> Bus:
    from hil.bus.socketcan import SocketcanBus

    return SocketcanBus(spec, bus)


def _open_python_can(spec: BusSpec, bus: BusName) -> Bus:
    from hil.bus.python_can import PythonCanBus

    return PythonCanBus(spec, bus)


BUS_KINDS: dict[str, Callable[[BusSpec, BusName], Bus]] = dict(
    zip(OWN_KINDS, (_open_loopback, _open_socketcan), strict=True)
)
"""How to open our own kinds."""


def open_bus(spec: str, bus: BusName) -> Bus:
    """Join a bus.

    Parameters
    ----------
    spec : ``KIND:CHANNEL[,OPTION=VALUE...]`` or ``auto`` (see `hil.bus.channel.resolve`).
    bus : which of the two buses it carries.

    Raises
    ------
    BusError : malformed, unknown kind, no such channel, no permission.
    """
    parsed = parse_spec(resolve(spec))
    return BUS_KINDS.get(parsed.kind, _open_python_can)(parsed, bus)

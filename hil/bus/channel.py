"""Which channel a bench takes, and that no second bench takes it.

A claim is a bound abstract Unix socket (unix(7)): exclusive, no file to be left behind, gone with the process however
that ends, and, unlike a lock file in a user's directory, seen by every user of the machine, as an interface is.
"""

import hashlib
import os
import re
import socket
import struct
from pathlib import Path
from types import TracebackType
from typing import Self

from hil.bus.bus import BusError, BusSpec, parse_spec
from hil.bus.rendezvous import base_directory

AUTO = "auto"
_VCAN = "socketcan:vcan0"
_LOOPBACK = "loopback:brakebench"
_MOST_BENCHES = 100
_ASKERS = 1000  # who may ask for the holder's name: nobody answers them, the kernel does
_IFF_UP = 1  # linux/if.h


def vcan_refusal() -> str:
    """Return why ``vcan0`` cannot be used here; empty where it can."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return "this system has no SocketCAN"
    flags = Path("/sys/class/net/vcan0/flags")
    if not flags.exists():
        return "there is no vcan0"
    return "" if int(flags.read_text(), 16) & _IFF_UP else "vcan0 is down"


def resolve(spec: str) -> str:
    """Return ``spec``; for ``auto``, vcan0 where there is one, else the loopback of the default name."""
    if spec != AUTO:
        return spec
    return _LOOPBACK if vcan_refusal() else _VCAN


def bench_channel(vehicle_spec: str) -> str:
    """Return the bench bus that belongs to a vehicle bus: always a loopback, the same for all who ask."""
    return f"{shared_channel(vehicle_spec)}-bench"


def shared_channel(vehicle_spec: str) -> str:
    """Return the loopback on which an adapter is shared; its bench bus is the adapter's."""
    spec = parse_spec(resolve(vehicle_spec))
    name = spec.channel if spec.kind == "loopback" else f"{spec.kind}-{spec.channel}"
    name = re.sub(r"[^A-Za-z0-9._-]", "-", name)
    if len(name) > 42:
        name = f"{name[:33]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
    return f"loopback:{name}"


class ChannelClaim:
    """A channel that is ours until closed, or until this process ends.

    Attributes
    ----------
    spec : the channel, for `hil.bus.open_bus`.
    note : why this one, for people; empty where it was asked for by name.
    """

    def __init__(self, spec: str, note: str, held: socket.socket) -> None:
        self.spec = spec
        self.note = note
        self._held = held

    def close(self) -> None:
        """Give the channel back."""
        self._held.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def claim_channel(spec: str) -> ChannelClaim:
    """Take a vehicle channel (and so its bench channel) for one bench.

    Parameters
    ----------
    spec : a bus, or ``auto``: vcan0 where there is one and no bench has it, else the first free loopback of
        ``brakebench``, ``brakebench-2``, ...

    Raises
    ------
    BusError : another bench has it; it says which process.
    """
    if spec != AUTO:
        held = _hold(spec)
        if isinstance(held, str):
            raise BusError(f"bus {spec}: in use by another bench, {held}; stop that one, or take another channel")
        return ChannelClaim(spec, "", held)
    refusal = vcan_refusal()
    if not refusal:
        held = _hold(_VCAN)
        if not isinstance(held, str):
            return ChannelClaim(_VCAN, "vcan0 is there", held)
        refusal = f"another bench, {held}, has vcan0"
    for number in range(1, _MOST_BENCHES + 1):
        candidate = _LOOPBACK if number == 1 else f"{_LOOPBACK}-{number}"
        held = _hold(candidate)
        if not isinstance(held, str):
            return ChannelClaim(candidate, refusal, held)
    raise BusError(f"bus auto: {_MOST_BENCHES} benches have all of {_LOOPBACK} to {_LOOPBACK}-{_MOST_BENCHES}")


def claim_adapter(spec: BusSpec) -> socket.socket:
    """Take an adapter for this process, until closed: two readers of one port would take each other's bytes.

    Raises
    ------
    BusError : another process has it; it says which, and how to share it.
    """
    place = os.path.realpath(spec.channel) if spec.channel.startswith("/") else spec.channel
    held = _bind(f"adapter\n{spec.kind}:{place}")
    if isinstance(held, str):
        share = shared_channel(spec.name)
        raise BusError(
            f"bus {spec.name}: busy, {held} has it, and an adapter has one owner; stop that one, or share it: "
            f"brakebench share --bus {spec.name}, and --bus {share} for all others"
        )
    return held


def claim_tunnel(spec: BusSpec) -> socket.socket:
    """Take a loopback for one end of a tunnel, until closed: with two, frames could go round for ever.

    Raises
    ------
    BusError : another process has an end there; it says which.
    """
    held = _bind(f"tunnel\n{base_directory()}\n{spec.name}")
    if isinstance(held, str):
        raise BusError(
            f"bus {spec.name}: {held} has an end of a tunnel there, and with two frames could go round for ever; "
            "stop that one, or take another loopback"
        )
    return held


def _hold(spec: str) -> socket.socket | str:
    """Bind the channel's claim, or return who has it."""
    parsed = parse_spec(spec)
    scope = str(base_directory()) if parsed.kind == "loopback" else "machine"
    return _bind(f"{scope}\n{parsed.name}")


def _bind(what: str) -> socket.socket | str:
    address = b"\0brakebench/" + hashlib.sha256(what.encode()).hexdigest().encode()
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        claim.bind(address)
        claim.listen(_ASKERS)
    except OSError:
        claim.close()
        return _holder(address)
    return claim


def _holder(address: bytes) -> str:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK) as asker:
        try:
            asker.connect(address)
        except OSError:
            return "whose process is unknown"
        process = struct.unpack("3i", asker.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]
        return f"process {process}"

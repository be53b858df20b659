"""Open and close python-can's drivers; what they raise, in words a person can act on."""

import errno
import logging
import socket
import struct
from typing import TYPE_CHECKING, Any

from hil.bus.bus import BUS_KINDS, BusError, BusSpec

if TYPE_CHECKING:
    import can

DEFAULT_BITRATE = 500_000
_SO_RCVBUFFORCE, _SO_MEMINFO, _MEMINFO_DROPS = 33, 55, 8  # asm-generic/socket.h, linux/sock_diag.h
_RECEIVE_BYTES = 1 << 20


def error_number(error: Exception) -> int | None:
    """Return the errno of whatever a driver raised."""
    return getattr(error, "error_code", None) or getattr(error, "errno", None)


def kernel_drops(driver: "can.BusABC") -> int:
    """Return how many frames the kernel has dropped on a socket with a full queue; 0 for other drivers."""
    link = getattr(driver, "socket", None)
    if not isinstance(link, socket.socket):
        return 0
    try:
        info = link.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 64)
    except OSError:  # closed, or a kernel before 4.12
        return 0
    return int(struct.unpack_from("I", info, 4 * _MEMINFO_DROPS)[0]) if len(info) > 4 * _MEMINFO_DROPS else 0


def _widen(driver: "can.BusABC") -> None:
    """Ask for a longer receive queue: the default holds about 250 frames."""
    link = getattr(driver, "socket", None)
    if isinstance(link, socket.socket):
        try:
            link.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _RECEIVE_BYTES)
        except OSError:  # not privileged
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)


def shut(driver: "can.BusABC") -> None:
    """Close a driver, whatever state its device is in."""
    try:
        driver.shutdown()
    except Exception:  # the device is gone: nothing is left to be closed
        logging.getLogger("can").debug("shutdown failed", exc_info=True)


def open_driver(spec: BusSpec) -> tuple["can.BusABC", "can.Message | None"]:
    """Open and try to read: a socketcan interface that is down opens, but does not read."""
    import can

    log = logging.getLogger("can")
    if log.level == logging.NOTSET:
        log.setLevel(logging.CRITICAL)
    channel: Any = int(spec.channel) if spec.channel.isdigit() else spec.channel
    if spec.kind not in can.VALID_INTERFACES:
        kinds = ", ".join(sorted({kind.kind for kind in BUS_KINDS} | can.VALID_INTERFACES))
        raise BusError(f"bus {spec.name}: there is no kind {spec.kind!r}, only {kinds}")
    try:
        driver = can.Bus(channel=channel, interface=spec.kind, ignore_config=True, **_options(spec))
    except Exception as error:  # drivers raise ImportError, OSError, NameError, ...
        raise BusError(f"bus {spec.name}: {_reason(spec, error)}") from error
    try:
        _widen(driver)
        return driver, driver.recv(0.0)
    except Exception as error:
        shut(driver)
        raise BusError(f"bus {spec.name}: {_reason(spec, error)}") from error


def _options(spec: BusSpec) -> dict[str, Any]:
    import can

    options: dict[str, Any] = dict(spec.options)
    listen_only = options.pop("listen_only", False)
    if spec.kind == "socketcan":
        if listen_only or "bitrate" in options:
            raise BusError(
                f"bus {spec.name}: socketcan takes bit rate and listen-only from the link: "
                f"sudo ip link set {spec.channel} type can bitrate 500000 listen-only on"
            )
        return options
    options.setdefault("bitrate", DEFAULT_BITRATE)
    if listen_only:
        modes: dict[str, dict[str, Any]] = {
            "kvaser": {"driver_mode": False},
            "pcan": {"state": can.BusState.PASSIVE},
            "slcan": {"listen_only": True},
            "vector": {"listen_only": True},
        }
        if spec.kind not in modes:
            raise BusError(f"bus {spec.name}: listen_only is known of {', '.join(modes)}, not of {spec.kind}")
        options |= modes[spec.kind]
    return options


def _reason(spec: BusSpec, error: Exception) -> str:
    text = str(error) or type(error).__name__
    if spec.kind != "socketcan":
        return f"{text} (is the driver of {spec.kind} installed, the adapter attached?)"
    code = error_number(error)
    if code in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT) or isinstance(error, AttributeError):
        return f"{text}; this kernel has no SocketCAN: sudo modprobe can-raw, or use loopback:NAME"
    if code == errno.ENETDOWN:
        return f"{text}; bring it up: sudo ip link set {spec.channel} up"
    if code == errno.ENODEV:
        return f"{text}; see `ip link`; a virtual one: sudo ip link add dev {spec.channel} type vcan"
    return text

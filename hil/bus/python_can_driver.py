"""Open and close python-can's drivers; what they raise, in words a person can act on."""

import errno
import logging
from typing import TYPE_CHECKING, Any

from hil.bus.buffered_port import BufferedPort
from hil.bus.bus import OWN_KINDS, BusError, BusSpec
from hil.bus.open_errors import reason

if TYPE_CHECKING:
    import can

DEFAULT_BITRATE = 500_000
LISTEN_ONLY: dict[str, tuple[str, Any]] = {
    "cantact": ("monitor", True),
    "kvaser": ("driver_mode", False),
    "nixnet": ("listen_only", True),
    "pcan": ("state", "PASSIVE"),
    "seeedstudio": ("operation_mode", "silent"),
    "slcan": ("listen_only", True),
    "systec": ("state", "PASSIVE"),
    "vector": ("listen_only", True),
}
"""By interface: the option, and its value, that keeps the controller from acknowledging and sending."""
_GONE = {errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EIO, errno.EBADF, errno.EPIPE, errno.ENETUNREACH}


def error_number(error: Exception) -> int | None:
    """Return the errno of whatever a driver raised."""
    return getattr(error, "error_code", None) or getattr(error, "errno", None)


def is_gone(error: Exception) -> bool:
    """Whether a driver's error says that there is no device any more."""
    return error_number(error) in _GONE


def descriptor(driver: "can.BusABC") -> int:
    """Return the driver's file descriptor; -1 where it has none."""
    try:
        return driver.fileno()
    except Exception:  # it has none; or it is just being unplugged
        return -1


def has_buffered(driver: "can.BusABC") -> bool:
    """Whether something that was read of the driver's descriptor is still to be taken."""
    port = getattr(driver, "serialPortOrig", None)
    return isinstance(port, BufferedPort) and port.buffered > 0


def shut(driver: "can.BusABC") -> None:
    """Close a driver, whatever state its device is in."""
    try:
        driver.shutdown()
    except Exception:  # the device is gone: nothing is left to be closed
        logging.getLogger("can").debug("shutdown failed", exc_info=True)


def open_driver(spec: BusSpec) -> tuple["can.BusABC", "can.Message | None"]:
    """Open and try to read: some devices that are not ready open, but do not read."""
    import can

    log = logging.getLogger("can")
    if log.level == logging.NOTSET:
        log.setLevel(logging.CRITICAL)
    channel: Any = int(spec.channel) if spec.channel.isdigit() else spec.channel
    if spec.kind not in can.VALID_INTERFACES:
        kinds = ", ".join(sorted(set(OWN_KINDS) | can.VALID_INTERFACES))
        raise BusError(f"bus {spec.name}: there is no kind {spec.kind!r}, only {kinds}")
    options = _options(spec)
    try:
        driver = can.Bus(channel=channel, interface=spec.kind, ignore_config=True, **options)
    except Exception as error:  # drivers raise ImportError, OSError, NameError, ...
        raise BusError(f"bus {spec.name}: {reason(spec, error)}") from error
    if spec.kind == "slcan":
        # slcan's own attribute, which BusABC does not declare
        driver.serialPortOrig = BufferedPort(driver.serialPortOrig)  # type: ignore[attr-defined]
    try:
        return driver, driver.recv(0.0)
    except Exception as error:
        shut(driver)
        raise BusError(f"bus {spec.name}: {reason(spec, error)}") from error


def _options(spec: BusSpec) -> dict[str, Any]:
    import can

    options: dict[str, Any] = dict(spec.options)
    listen_only = options.pop("listen_only", False)
    options.setdefault("bitrate", DEFAULT_BITRATE)
    if listen_only:
        if spec.kind not in LISTEN_ONLY:
            raise BusError(f"bus {spec.name}: listen_only is known of {', '.join(LISTEN_ONLY)}, not of {spec.kind}")
        name, value = LISTEN_ONLY[spec.kind]
        options[name] = can.BusState[value] if name == "state" else value
    return options

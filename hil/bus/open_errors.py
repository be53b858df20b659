"""Why an adapter did not open, and the command that mends it: drivers raise what they like."""

import errno
from collections.abc import Iterator
from pathlib import Path

from hil.bus.bus import BusSpec

_PORTS = ("ttyACM*", "ttyUSB*")
_SERIAL = ("slcan", "seeedstudio", "robotell", "serial")
_WINDOWS_ONLY = ("etas", "iscan", "ixxat", "nican", "nixnet", "systec", "usb2can", "vector")
_PACKAGES = {
    "canalystii": "canalystii", "cantact": "cantact", "gs_usb": "gs_usb", "neovi": "python-ics",
    "socketcand": "python-can", **dict.fromkeys(_SERIAL, "pyserial"),
}  # fmt: skip
_LIBRARIES = {"kvaser": "Kvaser's CANlib (libcanlib.so)", "pcan": "PEAK's PCAN-Basic (libpcanbasic.so)"}
_KERNEL_DRIVERS = {"gs_usb": "gs_usb", "kvaser": "kvaser_usb", "pcan": "peak_usb"}


def reason(spec: BusSpec, error: Exception) -> str:
    """What went wrong, and what to do, in one line for people."""
    kind, channel = spec.kind, spec.channel
    text = " ".join(str(error).split()) or type(error).__name__
    numbers = set(_numbers(error))
    if kind in _SERIAL and channel.isdigit():
        return f"expected the path of a serial port, such as {kind}:/dev/ttyACM0, got {channel}; {_ports()}"
    if _is_without_driver(error):
        said = "" if isinstance(error, NameError) or kind in _WINDOWS_ONLY else f" ({text})"
        return f"the driver of {kind} is not here{said}; {_driver(kind)}"
    if isinstance(error, TypeError) and "argument" in text:
        return f"{text}; give them as options: {kind}:{channel},KEY=VALUE,..."
    if errno.EACCES in numbers or errno.EPERM in numbers:
        mend = "sudo usermod -aG dialout $USER, then log in again" if kind in _SERIAL else "a udev rule gives it"
        return f"no permission for {channel}; {mend}"
    if errno.EBUSY in numbers:
        return f"{channel} is in use by another program; find it: fuser -v {channel}"
    if errno.ENOENT in numbers and kind in _SERIAL:
        return f"could not open port {channel}: there is none; {_ports()}"
    if errno.ENOTTY in numbers or "Inappropriate ioctl" in text:
        return f"{channel} is no serial port; {_ports()}"
    return f"{text}; is the adapter attached, and the channel right? brakebench doctor lists what is found"


def _numbers(error: BaseException | None) -> Iterator[int]:
    """Error numbers of an error and of what led to it."""
    for _ in range(5):
        if error is None:
            return
        number = getattr(error, "errno", None) or getattr(error, "error_code", None)
        if isinstance(number, int):
            yield number
        error = error.__cause__ or error.__context__


def _is_without_driver(error: Exception) -> bool:
    """Missing libraries come as missing names, modules, interfaces, or as an OSError without a number."""
    if isinstance(error, OSError):
        return error.errno is None and "library" in str(error)
    # python-can: a driver's names are missing, its module is, or it has no such interface (NotImplementedError)
    return isinstance(error, (NameError, ImportError, NotImplementedError))


def _driver(kind: str) -> str:
    if kind in _WINDOWS_ONLY:
        return f"python-can opens {kind} on Windows only; on Linux see whether the kernel has the adapter: ip link"
    ways = []
    if kind in _KERNEL_DRIVERS:
        ways.append(
            f"take the kernel's: sudo modprobe {_KERNEL_DRIVERS[kind]} && sudo ip link set can0 up type can bitrate "
            "500000, then --bus socketcan:can0"
        )
    if kind in _LIBRARIES:
        ways.append(f"install {_LIBRARIES[kind]}")
    if kind in _PACKAGES:
        ways.append(f"pip install {_PACKAGES[kind]}")
    return "; or ".join(ways) or "install it as python-can's page of this interface says"


def _ports() -> str:
    found = sorted(str(path) for pattern in _PORTS for path in Path("/dev").glob(pattern))
    return f"ports here: {', '.join(found) or 'none, is the adapter plugged in? dmesg | tail'}"

"""Adapters that python-can's drivers find attached; as a program, since a vendor's library may hang or crash.

``python -m hil.bus.adapters`` prints a JSON list of buses as `hil.bus.bus.open_bus` takes them.
"""

import json
import logging
from collections.abc import Iterable

_USB_PORTS = ("/dev/ttyACM", "/dev/ttyUSB")
_NO_HARDWARE = {"virtual", "udp_multicast", "brakebench", "socketcan"}  # the kernel's interfaces are looked at directly


def attached_adapters() -> list[str]:
    """Return ``INTERFACE:CHANNEL`` of everything found."""
    import can

    logging.getLogger("can").setLevel(logging.CRITICAL)
    return buses((str(one["interface"]), str(one["channel"])) for one in can.detect_available_configs())


def buses(found: Iterable[tuple[str, str]]) -> list[str]:
    """Return buses of interfaces and channels; a USB serial port most likely speaks slcan, a built-in one nothing."""
    named = []
    for interface, channel in found:
        if interface == "serial":
            named += [f"slcan:{channel}"] if channel.startswith(_USB_PORTS) else []
        elif interface not in _NO_HARDWARE:
            named.append(f"{interface}:{channel}")
    return named


if __name__ == "__main__":
    print(json.dumps(attached_adapters()))

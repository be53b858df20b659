"""Adapters that python-can's drivers find attached; as a program, since a vendor's library may hang or crash.

``python -m hil.bus.adapters`` prints a JSON list of buses as `hil.bus.bus.open_bus` takes them.
"""

import json
import logging

_NO_HARDWARE = {"virtual", "udp_multicast", "brakebench", "socketcan"}  # the kernel's interfaces are looked at directly


def attached_adapters() -> list[str]:
    """Return ``INTERFACE:CHANNEL`` of everything found."""
    import can

    logging.getLogger("can").setLevel(logging.CRITICAL)
    found = can.detect_available_configs()
    return [f"{one['interface']}:{one['channel']}" for one in found if one["interface"] not in _NO_HARDWARE]


if __name__ == "__main__":
    print(json.dumps(attached_adapters()))

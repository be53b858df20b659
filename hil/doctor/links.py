"""The kernel's CAN: SocketCAN itself, vcan, and the settings of every CAN interface."""

import json
import platform
import shutil
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dbc.contract import contract
from dbc.frame import BusName
from hil.doctor.line import Line, Status, as_root, read
from hil.rt.process import output_of

_ARPHRD_CAN = 280  # linux/if_arp.h
_IFF_UP = 1  # linux/if.h
QUEUE_FRAMES = 100
"""A node sends its tick's frames at once; the kernel's default of 10 for adapters refuses some of them."""
RESTART_MS = 100


def kernel_lines(root: Path = Path("/")) -> list[Line]:
    """SocketCAN, `ip`, vcan0 and every other CAN interface."""
    present = socketcan_present()
    lines = [socketcan_line(present, root)]
    names = interfaces(root)
    if shutil.which("ip") is None and (present or names):
        fix = as_root("apt-get install iproute2")
        lines.append(Line("iproute2", Status.MISSING, "no `ip` command: links can be neither set up nor read", fix))
    lines.append(vcan_line(present, root))
    details = link_details()
    for name in names:
        if name != "vcan0":
            lines.append(link_line(name, details.get(name, {}), root, contract(BusName.VEHICLE).bit_rate))
    return lines


def socketcan_present() -> bool:
    """Whether this kernel opens a CAN socket."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def interfaces(root: Path) -> list[str]:
    """Names of the CAN interfaces."""
    folder = root / "sys/class/net"
    found = folder.iterdir() if folder.is_dir() else ()
    return sorted(path.name for path in found if read(path / "type") == str(_ARPHRD_CAN))


def link_details() -> dict[str, Mapping[str, Any]]:
    """What `ip` knows of each link; empty where it cannot be asked."""
    text = output_of(("ip", "-details", "-json", "link", "show"), 5.0)
    try:
        return {link["ifname"]: link for link in json.loads(text or "[]") if "ifname" in link}
    except ValueError:
        return {}


def socketcan_line(present: bool, root: Path) -> Line:
    """Whether the kernel has SocketCAN, or could load it, or which package brings it."""
    if present:
        return Line("SocketCAN", Status.OK, f"in Linux {platform.release()}")
    release = platform.release()
    modules = root / "lib/modules" / release
    if "can-raw" in read(modules / "modules.dep"):
        return Line("SocketCAN", Status.MISSING, "the kernel's module is not loaded", as_root("modprobe can-raw"))
    system = read(root / "etc/os-release")
    fix = ""
    if modules.is_dir() and "ID=ubuntu" in system:
        fix = as_root(f"apt-get install linux-modules-extra-{release}")
    elif modules.is_dir() and "ID=debian" in system and "cloud" in release:
        fix = as_root("apt-get install linux-image-amd64", "reboot")
    finding = f"not in this kernel ({release}); without it: --bus loopback:NAME, or an adapter by python-can"
    return Line("SocketCAN", Status.MISSING, finding, fix)


def vcan_line(present: bool, root: Path) -> Line:
    """Whether vcan0 is there and up."""
    up = "ip link set vcan0 up"
    if not present:
        return Line("vcan0", Status.MISSING, "needs SocketCAN")
    flags = read(root / "sys/class/net/vcan0/flags")
    if not flags:
        fix = as_root("modprobe vcan", "ip link add dev vcan0 type vcan", up)
        return Line("vcan0", Status.MISSING, "no such interface; --bus auto then takes a loopback", fix)
    if not int(flags, 16) & _IFF_UP:
        return Line("vcan0", Status.WARNING, "down", as_root(up))
    return Line("vcan0", Status.OK, "up; --bus auto takes it")


def link_line(name: str, details: Mapping[str, Any], root: Path, bit_rate: int) -> Line:
    """Settings of one CAN interface, and one command for all that is unwise.

    Parameters
    ----------
    details : the link as ``ip -details -json link show`` gives it; empty where it could not be asked.
    bit_rate : that of our vehicle bus, bit/s.
    """
    folder = root / "sys/class/net" / name
    queue = int(read(folder / "tx_queue_len") or 0)
    up = bool(int(read(folder / "flags") or "0", 16) & _IFF_UP)
    info = details.get("linkinfo", {})
    if info.get("info_kind") in ("vcan", "vxcan"):
        fix = "" if up else as_root(f"ip link set {name} up")
        return Line(name, Status.OK if up else Status.WARNING, f"virtual, {'up' if up else 'down'}", fix)
    data = info.get("info_data", {})
    facts, wrong, settings = ["up" if up else "down"], [] if up else ["it is down"], []
    if not data:
        wrong.append("its bit rate could not be read")
    else:
        rate = data.get("bittiming", {}).get("bitrate") or data.get("bittiming_bitrate") or 0
        listen_only = "LISTEN-ONLY" in data.get("ctrlmode", ())
        restart_ms = int(data.get("restart_ms", 0))
        restarts = "bitrate_const" not in data  # drivers with fixed rates (slcan) refuse restart-ms
        facts += [f"{rate} bit/s" if rate else "no bit rate", str(data.get("state", "")).lower()]
        facts += [f"listen-only {'on' if listen_only else 'off'}", f"restart-ms {restart_ms}"]
        if rate != bit_rate:
            wrong.append(f"brake.dbc says {bit_rate} bit/s")
        if rate != bit_rate or not rate:
            settings.append(f"bitrate {bit_rate}")
        if listen_only:
            wrong.append("listen-only: it records, but nothing can be sent")
            settings.append("listen-only off")
        if restart_ms == 0 and restarts:
            wrong.append("after bus-off it would stay off")
            settings.append(f"restart-ms {RESTART_MS}")
        elif restart_ms == 0:
            facts.append("this driver has no automatic restart")
    facts.append(f"txqueuelen {queue}")
    if queue < QUEUE_FRAMES:
        wrong.append(f"a queue of {queue} refuses frames of a tick")
    finding = ", ".join(fact for fact in facts if fact) + ("; " + "; ".join(wrong) if wrong else "")
    return Line(name, Status.WARNING if wrong else Status.OK, finding, _set(name, up, queue, settings))


def _set(name: str, up: bool, queue: int, settings: list[str]) -> str:
    """Command for everything that is to be changed; settings of the controller need the link down."""
    commands = []
    if queue < QUEUE_FRAMES:
        commands.append(f"ip link set {name} txqueuelen {QUEUE_FRAMES}")
    if settings:
        commands += [f"ip link set {name} down"] if up else []
        commands.append(f"ip link set {name} type can {' '.join(settings)}")
    if settings or not up:
        commands.append(f"ip link set {name} up")
    return as_root(*commands) if commands else ""

"""The other process of ``hil.validation.perf.rt``: ``python -m hil.validation.perf.rt_child ROLE ...``."""

import json
import os
import sys
from collections.abc import Callable
from itertools import islice

from dbc.frame import BusName, Frame
from hil.bus import open_bus
from hil.rt.clock import WallClock
from hil.rt.loop import Loop
from hil.rt.realtime import request_realtime

END_ID = 0x7FF


def echo(core: str, spec: str) -> None:
    """Send back every frame of a bus of ours until one of `END_ID`."""
    os.sched_setaffinity(0, {int(core)})
    with open_bus(spec, BusName.VEHICLE) as bus:
        print("ready", flush=True)
        while True:
            for item in bus.receive(10.0):
                if isinstance(item, Frame):
                    if item.can_id == END_ID:
                        return
                    bus.send([item])


def remote_echo(core: str, url: str) -> None:
    """Send back every frame of python-can-remote's bus, with the next identifier: it returns what one sends."""
    import can

    os.sched_setaffinity(0, {int(core)})
    with can.Bus(url, interface="remote", bitrate=500_000) as bus:
        print("ready", flush=True)
        while (message := bus.recv(10.0)) is not None and message.arbitration_id != END_ID:
            if message.arbitration_id == 1:
                bus.send(can.Message(arbitration_id=2, is_extended_id=False, data=message.data))


def ticks(period_ns: str, count: str, spin_ns: str) -> None:
    """Run an empty loop as ``--realtime`` does and print its lateness, ns."""
    grants = {grant.what: grant.granted for grant in request_realtime()}
    loop = Loop(WallClock(int(spin_ns)), int(period_ns))
    lateness_ns = [tick.lateness_ns for tick in islice(loop.ticks(), int(count))]
    print(json.dumps({"fifo": grants["SCHED_FIFO"], "lateness_ns": lateness_ns, "overruns": loop.overruns}))


if __name__ == "__main__":
    roles: dict[str, Callable[..., None]] = {"echo": echo, "remote-echo": remote_echo, "ticks": ticks}
    roles[sys.argv[1]](*sys.argv[2:])

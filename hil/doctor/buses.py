"""Buses that need no kernel CAN: the loopback, and the adapters python-can finds."""

import json
import os
import statistics
import sys

from dbc.frame import BusName, Frame
from hil.bus.bus import BusError
from hil.bus.channel import claim_channel
from hil.bus.open import open_bus
from hil.bus.rendezvous import base_directory
from hil.doctor.line import Line, Status
from hil.errors import in_words
from hil.rt.clock import monotonic_ns
from hil.rt.process import output_of

_ROUNDS = 200


def loopback_line() -> Line:
    """Use a loopback: claim a channel, join it twice, send to and fro."""
    directory = base_directory()
    channel = f"loopback:doctor-{os.getpid()}"
    ping = Frame(BusName.VEHICLE, 1, bytes(8))
    times_ns = []
    try:
        with (
            claim_channel(channel),
            open_bus(channel, BusName.VEHICLE) as here,
            open_bus(channel, BusName.VEHICLE) as there,
        ):
            for _ in range(_ROUNDS):
                start_ns = monotonic_ns()
                here.send([ping])
                answer = there.receive(1.0)
                there.send([ping])
                if not (answer and here.receive(1.0)):
                    raise BusError("a frame did not arrive within 1 s")
                times_ns.append(monotonic_ns() - start_ns)
    except (BusError, OSError) as error:
        fix = "" if os.access(directory.parent, os.W_OK) else "export XDG_RUNTIME_DIR=$(mktemp -d)"
        return Line("loopback", Status.MISSING, f"not usable in {directory}: {in_words(error)}", fix)
    trip_us = statistics.median(times_ns) * 1e-3
    return Line("loopback", Status.OK, f"usable in {directory}; round trip {trip_us:.0f} us within one process")


def adapters_line() -> Line:
    """What python-can's drivers find."""
    text = output_of((sys.executable, "-m", "hil.bus.adapters"), 15.0)
    if text is None:
        return Line("adapters", Status.WARNING, "python-can's drivers failed, or did not answer within 15 s")
    found = json.loads(text.strip().splitlines()[-1])
    if not found:
        return Line("adapters", Status.OK, "none found by python-can; needed for real hardware only")
    return Line("adapters", Status.OK, "for --bus: " + ", ".join(found))

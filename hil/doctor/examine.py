"""The whole examination, in the order in which a bench needs things."""

from hil.doctor.buses import adapters_line, loopback_line
from hil.doctor.line import Line, guarded
from hil.doctor.links import kernel_lines
from hil.doctor.machine import machine_lines
from hil.doctor.software import compiled_line, software_lines


def examine() -> list[Line]:
    """Look at everything; never raises."""
    return [
        *guarded("loopback", lambda: [loopback_line()]),
        *guarded("SocketCAN", kernel_lines),
        *guarded("adapters", lambda: [adapters_line()]),
        *guarded("machine", machine_lines),
        *guarded("packages", software_lines),
        *guarded("compiled code", lambda: [compiled_line()]),
    ]

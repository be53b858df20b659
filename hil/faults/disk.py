"""Faults of the recorder's process: killed, or its file may not grow any more. In real time only."""

import contextlib
import resource
import stat
from pathlib import Path

from dbc.frame import Received
from dbc.messages import BrakeMode
from hil.faults.act import Act
from hil.faults.fault import Expected, FaultKind, Parameter, Side
from hil.faults.targets import Takes
from hil.rt.process import kill_self


class Killed(Act):
    """The recorder is gone (SIGKILL)."""

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """Does not come back."""
        kill_self()
        return inbox


class Full(Act):
    """The recorder's file may not grow any more, or by some room: what a full disk is to it, and needs no rights.

    The kernel's limit of the size of files (setrlimit, RLIMIT_FSIZE), set to the largest file that the process has
    open: a write beyond it fails with EFBIG, where a full disk gives ENOSPC. Smaller files may grow up to it.
    """

    def hear(self, now_ns: int, inbox: list[Received]) -> list[Received]:
        """Set the limit."""
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        limit = _largest_open_file() + int(self.injection.number("room_bytes"))
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        return inbox


def _largest_open_file() -> int:
    """Bytes of the largest regular file that this process has open (proc(5))."""
    sizes = [0]
    for link in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):  # the descriptor of the listing itself
            status = link.stat()
            sizes += [status.st_size] if stat.S_ISREG(status.st_mode) else []
    return max(sizes)


_ROW = "recorder killed, disk full"
_NOTHING = Expected(frozenset({BrakeMode.NORMAL}))


def _kind(number: int, name: str, text: str, *parameters: Parameter) -> FaultKind:
    return FaultKind(
        number, name, "disk", text, _ROW, Side.RECORDER, Takes.RECORDER, ("RECORDER",), _NOTHING, parameters,
        of_target=False, in_virtual_time=False,
    )  # fmt: skip


FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (_kind(100, "recorder_killed", "The recorder is killed (SIGKILL); the loop goes on."), Killed),
    (_kind(101, "disk_full", "The recording may not grow any more (RLIMIT_FSIZE).",
           Parameter("room_bytes", "", 0.0, 1e9, 0.0, "by how many bytes it still may")), Full),
)  # fmt: skip

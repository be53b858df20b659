"""What a process can ask of Linux and Python to be on time, and what it got."""

import contextlib
import ctypes
import gc
import os
import resource
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

PRIORITY = 50
"""SCHED_FIFO priority, 1..99: above every ordinary process; the kernel's threaded interrupts have 50 too."""

GRANTED, NOT_GRANTED = "granted", "NOT granted"
_PR_SET_TIMERSLACK = 29  # linux/prctl.h
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # bits/mman-linux.h
_CAP_IPC_LOCK = 14  # linux/capability.h
_libc = ctypes.CDLL(None, use_errno=True)


class Grant(NamedTuple):
    """One thing asked for.

    Attributes
    ----------
    what : its name.
    granted : whether this process has it now.
    detail : what was set; or why not, and what would help.
    """

    what: str
    granted: bool
    detail: str


def request_timer_slack() -> Grant:
    """Let sleeps end within 1 ns of their deadline instead of 50 us: free, needs no privilege."""
    if _libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0:
        return Grant("timer slack", True, "1 ns")
    return Grant("timer slack", False, f"prctl: {os.strerror(ctypes.get_errno())}")


def request_realtime() -> list[Grant]:
    """Ask for all of it, after everything is imported and opened and before the loop starts."""
    steps: tuple[Callable[[], Grant], ...] = (request_timer_slack, _scheduling, _memory, _collection)
    return [step() for step in steps]


def request_punctuality(realtime: bool, say: Callable[[str], None]) -> None:
    """Ask for all with ``realtime``, else for what is free; say what was granted, of the free part a refusal alone."""
    for grant in request_realtime() if realtime else [request_timer_slack()]:
        if realtime or not grant.granted:
            say(f"{grant.what}: {GRANTED if grant.granted else NOT_GRANTED}, {grant.detail}")


def realtime_refusal() -> str:
    """Why this process would not be granted SCHED_FIFO, empty where it would; it is tried, and given back at once."""
    policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    kept = policy & os.SCHED_RESET_ON_FORK  # may be set by anybody, cleared with CAP_SYS_NICE alone: sched(7)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | kept, os.sched_param(PRIORITY))
    except OSError as error:
        return error.strerror or str(error)
    os.sched_setscheduler(0, policy, parameter)
    return ""


def _scheduling() -> Grant:
    """For every thread there is: a driver's threads hold what the node's own waits for."""
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        for thread in Path("/proc/self/task").iterdir():
            with contextlib.suppress(ProcessLookupError):  # it has just ended
                os.sched_setscheduler(int(thread.name), policy, os.sched_param(PRIORITY))
    except OSError as error:
        help_ = f"allow it: `ulimit -r {PRIORITY}` (limits.conf: rtprio), or setcap cap_sys_nice=ep"
        return Grant("SCHED_FIFO", False, f"{error.strerror}; {help_}")
    return Grant("SCHED_FIFO", True, f"priority {PRIORITY}")


def _memory() -> Grant:
    # with a limit, locking succeeds now and a later allocation fails: worse than not locked
    soft, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if soft != resource.RLIM_INFINITY and not _has_capability(_CAP_IPC_LOCK):
        help_ = "allow it: `ulimit -l unlimited` (limits.conf: memlock)"
        return Grant("locked memory", False, f"limited to {soft} bytes; {help_}")
    if _libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) == 0:
        return Grant("locked memory", True, "current and future pages")
    return Grant("locked memory", False, f"mlockall: {os.strerror(ctypes.get_errno())}")


def _has_capability(number: int) -> bool:
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return False
    effective = next((line.split()[1] for line in status.splitlines() if line.startswith("CapEff:")), "0")
    return bool(int(effective, 16) >> number & 1)


def _collection() -> Grant:
    gc.collect()
    gc.freeze()
    gc.disable()
    return Grant("no garbage collection", True, f"{gc.get_freeze_count()} objects frozen")

import errno
import gc
import os
import resource
import subprocess
import sys

import pytest

from hil.rt import realtime


@pytest.fixture(autouse=True)
def leave_this_process_as_it_was(monkeypatch):
    monkeypatch.setattr(gc, "disable", lambda: None)
    monkeypatch.setattr(gc, "freeze", lambda: None)


class Libc:
    def __init__(self, result):
        self.result = result

    def prctl(self, *arguments):
        return self.result

    def mlockall(self, flags):
        return self.result


def ask(monkeypatch, *, libc=0, scheduler=None, limit=resource.RLIM_INFINITY):
    def set_scheduler(pid, policy, parameter):
        if scheduler:
            raise OSError(scheduler, os.strerror(scheduler))

    monkeypatch.setattr(realtime, "_libc", Libc(libc))
    monkeypatch.setattr(os, "sched_setscheduler", set_scheduler)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (limit, limit))
    monkeypatch.setattr(realtime, "_has_capability", lambda number: False)
    return {grant.what: grant for grant in realtime.request_realtime()}


def test_what_was_got_is_said(monkeypatch):
    grants = ask(monkeypatch)
    assert set(grants) == {"timer slack", "SCHED_FIFO", "locked memory", "no garbage collection"}
    assert all(grant.granted and grant.detail for grant in grants.values())


def test_what_was_refused_is_said_with_a_remedy(monkeypatch):
    grants = ask(monkeypatch, libc=-1, scheduler=errno.EPERM, limit=8192)
    assert {what for what, grant in grants.items() if grant.granted} == {"no garbage collection"}
    assert "rtprio" in grants["SCHED_FIFO"].detail
    assert "limited to 8192 bytes" in grants["locked memory"].detail


def test_whether_it_would_be_granted_changes_nothing():
    before = os.sched_getscheduler(0)
    assert realtime.realtime_refusal() == realtime.realtime_refusal()
    assert os.sched_getscheduler(0) == before


def test_whether_it_would_be_granted_needs_no_right_to_clear_a_flag(monkeypatch):
    """Who has no more than rtprio may set SCHED_RESET_ON_FORK, and never clear it: sched(7)."""
    now = [os.SCHED_OTHER]

    def without_capability(_, policy, parameter):
        if now[0] & os.SCHED_RESET_ON_FORK and not policy & os.SCHED_RESET_ON_FORK:
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        now[0] = policy

    monkeypatch.setattr(os, "sched_getscheduler", lambda _: now[0])
    monkeypatch.setattr(os, "sched_setscheduler", without_capability)
    for flag in (0, os.SCHED_RESET_ON_FORK):
        now[0] = os.SCHED_OTHER | flag
        assert realtime.realtime_refusal() == ""
        assert now[0] == os.SCHED_OTHER | flag


def test_memory_is_not_locked_under_a_limit(monkeypatch):
    # it would succeed, and a later allocation would fail
    assert not ask(monkeypatch, limit=1 << 20)["locked memory"].granted


def test_for_real_in_a_process_of_its_own():
    program = """
import gc, os
from hil.rt.realtime import request_realtime
grants = {grant.what: grant for grant in request_realtime()}
assert not gc.isenabled() and gc.get_freeze_count() > 0
policy = os.sched_getscheduler(0)
assert grants["SCHED_FIFO"].granted == (policy & os.SCHED_FIFO == os.SCHED_FIFO), policy
assert open(f"/proc/self/timerslack_ns").read().strip() in ("1", "0"), "0: real-time tasks have none"
locked = next(line for line in open("/proc/self/status") if line.startswith("VmLck"))
assert grants["locked memory"].granted == (int(locked.split()[1]) > 0), locked
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

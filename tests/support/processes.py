"""Helpers of tests that look at processes."""

import json
import signal
import time
from pathlib import Path

RUN_LIMIT_S = 240.0  # a first start compiles the plant; on a busy machine everything takes several times as long


def heed_interrupts():
    """In a child before it runs: take SIGINT, which a shell's background jobs are started to ignore."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def wait_until(condition, what, limit_s=RUN_LIMIT_S):
    """Poll until ``condition()`` is true; its value is returned."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {limit_s} s in vain: {what}")


def children_of(pid):
    """Living children of a process: {word after `hil.cli.main`: pid}."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
            words = (stat.parent / "cmdline").read_text().split("\0")
        except OSError:
            continue
        if int(fields[1]) == pid and fields[0] != "Z" and "hil.cli.main" in words:
            found[words[words.index("hil.cli.main") + 1]] = int(stat.parent.name)
    return found


def alive(pid):
    """Whether a process exists and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def result_of(process, expected=0):
    """The JSON object of a finished ``run --json`` with that exit code, or one of several."""
    out, err = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode in (expected if isinstance(expected, tuple) else (expected,)), (
        f"exit {process.returncode}\n{out}\n{err}"
    )
    return json.loads(out)

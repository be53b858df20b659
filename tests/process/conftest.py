"""Real processes, as a user starts them."""

import os
import signal
import subprocess
import sys
import uuid

import pytest
from processes import RUN_LIMIT_S, heed_interrupts

from hil.errors import Verdict

COMMAND = [sys.executable, "-m", "hil.cli.main"]
INCONCLUSIVE = Verdict.INCONCLUSIVE.exit_code  # a busy machine disturbed the run: it tells nothing, and is made again
RUNS = 6  # in half a minute whoever disturbed them has ended


@pytest.fixture
def channel():
    """A loopback of this test's own."""
    return f"loopback:t{uuid.uuid4().hex[:10]}"


@pytest.fixture
def short(tmp_path):
    """A scenario of three seconds: a stop from 18 km/h."""
    path = tmp_path / "short.toml"
    path.write_text(
        """title = "short stop"
[start]
speed_mps = 5.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.6]]
[end]
duration_s = 8.0
after_standstill_s = 0.3
"""
    )
    return path.name


@pytest.fixture
def brakebench(tmp_path):
    """Run a command to its end in a folder of its own; ``check`` is the exit code that it must have, or several."""

    def run(*arguments, check=0, env=None):
        wanted = check if isinstance(check, tuple) else (check,)
        for _ in range(RUNS):
            done = subprocess.run(
                [*COMMAND, *arguments],
                cwd=tmp_path,
                capture_output=True,
                text=True,
                timeout=RUN_LIMIT_S,
                env=os.environ | (env or {}),
            )
            if done.returncode != INCONCLUSIVE or INCONCLUSIVE in wanted:
                break
        assert done.returncode in wanted, f"exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done

    return run


@pytest.fixture
def start(tmp_path):
    """Start a command and go on; whatever still runs at the end is killed."""
    started = []

    def begin(*arguments, program=COMMAND, env=None, stdin=False):
        process = subprocess.Popen(
            [*program, *arguments],
            cwd=tmp_path,
            stdin=subprocess.PIPE if stdin else None,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | (env or {}),
            preexec_fn=heed_interrupts,
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate(timeout=RUN_LIMIT_S)

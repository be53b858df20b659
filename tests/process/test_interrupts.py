"""Ctrl-C in the midst of a command: it ends at once, without a traceback, and goes on to nothing else."""

import os
import signal

import pytest
from processes import RUN_LIMIT_S

from hil.errors import INTERRUPTED_EXIT_CODE

# Where an interrupt comes into code that a library made by exec(), Python ends itself by SIGINT; a shell reads 130 too.
INTERRUPTED = (INTERRUPTED_EXIT_CODE, -signal.SIGINT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["compare", "short.toml", "--out", "o"], "driving"),
        (["compare", "short.toml", "--out", "o"], "measuring"),
        (["run", "short.toml", "--virtual", "--out", "o"], "measuring"),
        (["explain", "sample:weak_brake"], "simulating the nominal vehicle"),
        (["hide", "--effect", "pad_temp_fade", "--out", "o"], "driving pairs"),
        (["identify", "friction"], "reading and fitting"),
        (["reproduce", "--seeds", "1"], "identifying"),
        (["verify", "plant"], "verifying"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else value.split()[0],
)
def test_an_interrupted_command_ends_without_a_traceback(start, short, words, said):
    process = start(*words, "--bus", f"loopback:i{os.getpid()}") if words[0] == "compare" else start(*words)
    lines = []
    for line in process.stderr:
        lines.append(line)
        if said in line:
            break
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=RUN_LIMIT_S)
    assert said in lines[-1]
    assert process.returncode in INTERRUPTED, "".join(lines) + rest
    assert "Traceback" not in rest
    assert rest.count("measuring") <= (said == "driving")  # what was driven is measured; nothing more is driven

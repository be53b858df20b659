"""Any input of one megabyte is answered within 5 s of processor time and 256 MiB beyond the warmed process."""

import contextlib
import io
import os
import resource
import sys
import traceback
from pathlib import Path

import hostile
import pytest

from hil.cli.main import main

LIMIT_S = 5
LIMIT_KIB = 256 * 1024
ANSWERS = {0, 1, 2}


def status(key: str) -> int:
    with Path("/proc/self/status").open() as file:
        return next(int(line.split()[1]) for line in file if line.startswith(key))


def answer(words: list[str]) -> tuple[int, int, str]:
    """Exit code, memory beyond the begin (KiB) and standard error of a command in a child with limited time."""
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        code, grown, said = 99, 0, io.StringIO()
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
            with Path("/proc/self/clear_refs").open("w") as file:
                file.write("5")  # the peak begins anew
            before = status("VmRSS")
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
                code = main(words)
            grown = status("VmHWM") - before
        except BaseException:
            said.write(traceback.format_exc())
        os.write(into, f"{code} {grown} {said.getvalue()[-2000:]}".encode())
        os._exit(0)
    os.close(into)
    with os.fdopen(out) as file:
        text = file.read()
    _, how = os.waitpid(child, 0)
    if not text:
        return -os.WTERMSIG(how), 0, "ended by a signal"
    code, grown, said = text.split(" ", 2)
    return int(code), int(grown), said


@pytest.fixture(scope="module", autouse=True)
def warmed(tmp_path_factory):
    """Compiled passes and libraries are loaded before memory and time are counted."""
    path = tmp_path_factory.mktemp("warm") / "warm.log"
    path.write_bytes(hostile.LINE * 30_000)
    for suffix in (".asc", ".trc", ".blf", ".csv", ".mf4", ".pcapng", ".parquet"):
        with contextlib.redirect_stdout(io.StringIO()):
            main(["convert", str(path), str(path.with_suffix(suffix))])
            main(["decode", str(path.with_suffix(suffix))])


@pytest.mark.slow
@pytest.mark.parametrize("name", hostile.LOGS)
def test_a_log(tmp_path, name):
    path = tmp_path / "hostile.log"
    path.write_bytes(hostile.LOGS[name]())
    code, grown, said = answer(["decode", str(path), "--json"])
    assert code in ANSWERS, said
    assert grown < LIMIT_KIB


@pytest.mark.slow
@pytest.mark.parametrize("name", hostile.DATABASES)
def test_a_database(tmp_path, name):
    log, path = tmp_path / "a.log", tmp_path / "hostile.dbc"
    log.write_bytes(hostile.LINE)
    path.write_bytes(hostile.DATABASES[name]())
    code, grown, said = answer(["decode", str(log), "--dbc", str(path), "--json"])
    assert code in ANSWERS, said
    assert grown < LIMIT_KIB
    assert sys.getsizeof(said) < 10_000_000

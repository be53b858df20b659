import os
import shutil
import subprocess

import pytest

from hil.validation.perf import rt


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(rt, "ROUND_TRIPS", 30)
    monkeypatch.setattr(rt, "PAIRS", 1)
    monkeypatch.setattr(rt, "SECONDS", 0.05)


def test_rows_of_whatever_is_installed(capsys):
    before = os.sched_getaffinity(0)
    rows = rt.measure()
    assert os.sched_getaffinity(0) == before
    missing = capsys.readouterr().err
    expected = {"python-can virtual"}
    for installed, named, other in (
        (shutil.which("gcc") or shutil.which("cc"), "C compiler", "a Unix datagram in C, echoed: the floor"),
        (shutil.which("cyclictest"), "cyclictest", None),
    ):
        assert bool(installed) != (named in missing)
        if installed and other:
            expected.add(other)
    assert expected <= {row.other_is for row in rows}
    for row in rows:
        assert row.unit == "us"
        assert row.ours >= 0
        assert row.other > 0
        assert row.ratio > 0


def test_the_histogram_of_cyclictest_is_read_to_its_end(monkeypatch):
    lines = [
        "# /dev/cpu_dma_latency set to 0us",
        "# Histogram",
        "000000 000000",
        "000007 000040",
        "000009 000009",
        "# Total: 49",
    ]
    output = "\n".join(lines)  # 50 cycles were asked for: one is beyond the histogram
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, 0, output, ""))
    assert rt._cyclictest_us(1000, fifo=True) == (7.0, 50_000.0)


def test_an_answer_that_is_not_what_was_sent_ends_the_measurement():
    with pytest.raises(RuntimeError, match="came back as"):
        rt._times_us(lambda data: bytes(8) if data[0] == 3 else data)

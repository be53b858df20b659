import math
import sys

import pytest

from hil.validation.perf import decode

EVERYWHERE = [
    "frames to signals", "log to signals", "asc to signals", "blf to signals", "trc to signals",
    "python-can's csv to signals", "our csv to signals", "blf to frames",
]  # fmt: skip


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(decode, "FRAMES", 4000)
    monkeypatch.setattr(decode, "FEW", 400)


def test_every_row_is_measured(short):
    rows = {row.name: row for row in decode.measure()}
    assert set(EVERYWHERE) <= set(rows)
    assert all(math.isfinite(row.ours) and row.ours > 0.0 and row.ratio > 0.0 for row in rows.values())
    assert rows["mf4 to signals"].other_is == "asammdf extract_bus_logging"


def test_a_peer_that_is_not_installed_is_named_and_its_row_left_out(short, monkeypatch, capsys):
    for package in ("asammdf", "hilspy"):
        monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr(decode, "MDFR", "import package_that_is_not_there")
    assert [row.name for row in decode.measure()] == EVERYWHERE
    assert capsys.readouterr().err.count("is not installed") == 3

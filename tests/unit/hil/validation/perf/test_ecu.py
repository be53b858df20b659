import math

import pytest

from hil.validation.perf import ecu


@pytest.fixture
def short(monkeypatch):
    for name, value in (("STEPS", 20), ("BULK", 300), ("TICKS", 60)):
        monkeypatch.setattr(ecu, name, value)


def test_every_row_is_measured_and_the_ticks_are_held_against_their_period(short):
    rows = {row.name: row for row in ecu.measure()}
    assert all(math.isfinite(row.ours) and row.ratio > 0.0 for row in rows.values())
    assert rows["controller tick at 1 kHz"].other == 100.0
    assert rows["controller tick at 100 Hz"].other == 1000.0
    assert "joint filter step" in rows


def test_without_filterpy_its_rows_are_left_out_and_named(short, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "filterpy.kalman", None)
    names = [row.name for row in ecu.measure()]
    assert not any("16 states" in name for name in names)
    assert "filterpy is not installed" in capsys.readouterr().err

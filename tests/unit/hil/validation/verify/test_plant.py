"""Every number of every verification is within its limit; the command writes what it says."""

import argparse
import json

import pytest

from hil.validation.verify import plant
from hil.validation.verify.topic import Topic, below, within

COMMONROAD = {"tyre", "handling"}


def topic(name: str) -> Topic:
    if name in COMMONROAD:
        pytest.importorskip("vehiclemodels", reason="commonroad-vehicle-models is not installed")
    return plant.TOPICS[name]()


@pytest.mark.parametrize("name", plant.TOPICS)
def test_within_limits(name):
    result = topic(name)
    assert result.numbers
    missed = [(n.label, n.value, n.limit) for n in result.numbers if not n.met]
    assert not missed


def test_limits_can_be_missed():
    assert not below("a", -2.0, 1.0, "").met
    assert not below("a", float("nan"), 1.0, "").met
    assert not within("a", 2.0, 0.0, 1.0, "").met
    assert within("a", 1.0, 0.0, 1.0, "").met


@pytest.fixture
def only_limits(monkeypatch):
    monkeypatch.setattr(plant, "TOPICS", {"limits": plant.TOPICS["limits"]})


def test_command_writes_page_and_figures(only_limits, tmp_path, capsys):
    assert plant.main(argparse.Namespace(out=tmp_path / "new", json=False)) == 0
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"report.html", "limits.png"}
    assert "Over charge limit" in capsys.readouterr().out


def test_command_fails_when_a_number_does(monkeypatch, capsys):
    good = plant.TOPICS["limits"]()
    bad = Topic("t", "a", (below("x", 2.0, 1.0, "m"),), good.section)
    monkeypatch.setattr(plant, "TOPICS", {"one": lambda: bad})
    assert plant.main(argparse.Namespace(out=None, json=True)) == 1
    result = json.loads(capsys.readouterr().out)
    assert result["passed"] is False
    assert result["numbers"][0]["met"] is False

"""Without matplotlib, an extra: everything but pictures is written, and the command that installs it is named."""

import sys

import pytest

from hil.cli.main import main

CAMPAIGN = """title = "mass"
scenarios = ["stop72"]
method = "saltelli"
count = 4
[[vary]]
key = "plant.vehicle.mass_kg"
low = 1500.0
high = 1600.0
"""


@pytest.fixture
def bare(monkeypatch):
    """A Python without matplotlib."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)


def test_a_run_passes_and_says_how_to_get_the_figure(bare, tmp_path, capsys):
    assert main(["run", "stop72", "--virtual", "--out", str(tmp_path / "run")]) == 0
    shown = capsys.readouterr().out
    assert "PASSED" in shown
    assert "figure   no pictures without matplotlib; install it with: " in shown
    assert "pip install " in shown
    assert {path.name for path in (tmp_path / "run").iterdir()} >= {"recording.log", "signals.parquet", "report.html"}
    assert not (tmp_path / "run" / "figure.png").exists()


@pytest.mark.parametrize(
    ("module", "words"), [("vehiclemodels", ["verify", "plant"]), ("SALib", ["campaign", "c.toml"])]
)
def test_what_needs_an_extra_names_it_before_it_works(module, words, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    assert main(words) == 2
    told = capsys.readouterr().err
    assert f"needs {module}, which is not installed; install it with: " in told
    assert "pip install " in told
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]


def test_a_plot_is_a_page_and_a_picture_is_refused(bare, tmp_path, capsys):
    log = tmp_path / "a.log"
    log.write_text("".join(f"({k / 100:.6f}) bench 020#{k:04X}000000000000\n" for k in range(100)))
    for suffix, code in (("html", 0), ("png", 2)):
        assert main(["plot", str(log), "TRUTH_MOTION.SPEED", "--out", str(tmp_path / f"a.{suffix}")]) == code
    assert "pip install " in capsys.readouterr().err
    assert (tmp_path / "a.html").exists()
    assert not (tmp_path / "a.png").exists()

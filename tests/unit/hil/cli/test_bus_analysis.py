"""``brakebench bus-analysis``, and the page that shows what it says."""

import json
from pathlib import Path

import pytest

from hil.cli.main import main

ROOT = Path(__file__).parents[4]
BRAKE = ROOT / "dbc" / "brake.dbc"
PAGE = ROOT / "docs" / "bus-timing.md"


def test_the_page_shows_what_the_command_says(capsys, monkeypatch) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "100")
    assert main(["bus-analysis", "dbc/brake.dbc"]) == 0
    assert f"```\n{capsys.readouterr().out}```" in PAGE.read_text()


def test_every_deadline_of_ours_is_met_at_its_bit_rate_and_not_at_125(capsys) -> None:
    assert main(["bus-analysis", str(BRAKE), "--json"]) == 0
    ours = json.loads(capsys.readouterr().out)
    assert (ours["bit_rate"], ours["missed"], len(ours["messages"])) == (500_000, 0, 17)
    assert all(one["response_ms"] <= one["cycle_ms"] for one in ours["messages"])
    assert main(["bus-analysis", str(BRAKE), "--json", "--bitrate", "125000"]) == 1
    slow = json.loads(capsys.readouterr().out)
    assert slow["load"] == pytest.approx(4 * ours["load"])
    assert slow["missed"] == sum(one["missed"] for one in slow["messages"]) > 0
    assert slow["messages"][-1]["response_ms"] is None
    assert main(["bus-analysis", str(BRAKE), "--bitrate", "125000"]) == 1
    text = capsys.readouterr().out
    assert "MISSED" in text
    assert "no bound" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.dbc"], "cannot be opened"),
        (["plain.dbc"], "states no bit rate"),
        (["plain.dbc", "--bitrate", "500000"], "none of its 1 messages"),
        (["plain.dbc", "--bitrate", "fast"], "expected bit/s"),
        (["plain.dbc", "--bitrate", "can0=500000"], "the rate alone"),
        (["plain.dbc", "--jitter", "-1"], "--jitter"),
    ],
)
def test_what_it_cannot_use(words, said, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("plain.dbc").write_text('VERSION ""\nBU_: E\nBO_ 291 M: 8 E\n SG_ A : 0|8@1+ (1,0) [0|255] "u" E\n')
    assert main(["bus-analysis", *words]) == 2
    assert said in capsys.readouterr().err

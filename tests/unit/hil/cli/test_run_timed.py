"""``brakebench run --virtual --bus timed``."""

import json

import pytest

from hil.cli.main import main
from hil.log.read import read_log


@pytest.mark.slow
def test_a_stop_on_a_timed_bus(tmp_path, capsys) -> None:
    out = tmp_path / "run"
    assert main(["run", "stop72", "--virtual", "--bus", "timed:250000", "--json", "--out", str(out)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["bus"], said["verdict"], said["frames_lost"]) == ("timed:250000", "passed", 0)
    assert said["bus_load"] == pytest.approx(0.788, abs=0.01)
    frames = read_log(out / "recording.log").frames
    stamps = frames.time_ns[frames.channel == frames.channels.index("vehicle")]
    assert min(stamps[1:] - stamps[:-1]) >= 111 * 4_000  # no two frames of eight bytes are nearer at 250 kbit/s


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--bus", "timed"], "add --virtual"),
        (["--virtual", "--bus", "loopback:x"], "or give --bus timed"),
        (["--virtual", "--bus", "timed:fast"], "bit rate"),
    ],
)
def test_what_does_not_go_together(words, said, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "stop72", *words]) == 2
    assert said in capsys.readouterr().err
    assert not [*tmp_path.glob("runs/*/recording.log")]

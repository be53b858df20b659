import numpy as np
import pytest

from hil.log import builder
from hil.log.frames import FrameTable, LogError
from hil.log.several import Logs

BASE = 1_700_000_000


@pytest.fixture
def write(tmp_path):
    def write(name, stamps, channel):
        path = tmp_path / name
        path.write_text("".join(f"({BASE + t:.6f}) {channel} 001#{k % 256:02X}\n" for k, t in enumerate(stamps)))
        return path

    return write


def joined(logs):
    tables = list(logs.tables())
    return FrameTable.joined(tables, tables[-1].channels)


@pytest.mark.parametrize("rows", [3, 65_536])
def test_logs_that_overlap_are_merged_by_their_stamps(write, monkeypatch, rows):
    monkeypatch.setattr(builder.FrameBuilder.__init__, "__defaults__", (None, rows))
    rng = np.random.default_rng(1)
    stamps = [np.sort(rng.random(50)) * span + begin for begin, span in ((0, 10), (5, 10), (100, 1))]
    paths = [write(f"{k}.log", some, f"can{k}") for k, some in enumerate(stamps)]
    with Logs([paths[2], paths[1], paths[0]]) as logs:
        assert [part.path for part in logs.parts] == paths
        for _ in range(2):  # it can be read again
            frames = joined(logs)
            assert len(frames) == 150
            assert (np.diff(frames.time_ns) >= 0).all()
            for k in range(3):
                chosen = frames.take(frames.channel == frames.channels.index(f"can{k}"))
                assert chosen.data[:, 0].tolist() == list(range(50))
        assert [part.frames for part in logs.parts] == [50, 50, 50]
        assert logs.whole


def test_the_order_within_a_log_stays(write):
    stamps = [1, 5, 2, 6, 3]
    with Logs([write("a.log", stamps, "can0"), write("b.log", [4.5], "can1")]) as logs:
        frames = joined(logs)
    chosen = frames.take(frames.channel == 0)
    assert chosen.data[:, 0].tolist() == [0, 1, 2, 3, 4]


def test_a_log_given_twice_is_refused(write):
    path = write("a.log", [1], "can0")
    with pytest.raises(LogError, match="given twice"):
        Logs([path, path])
    with pytest.raises(LogError, match=r"is given twice, as .*a\.log too"):
        Logs([path, path.parent / ".." / path.parent.name / "a.log"])


def test_one_bad_log_is_named(write, tmp_path):
    with pytest.raises(LogError, match=r"none\.log"):
        Logs([write("a.log", [1], "can0"), tmp_path / "none.log"])


def test_an_account_of_each_log(write, tmp_path):
    bad = tmp_path / "bad.log"
    bad.write_text(f"({BASE}.5) can0 001#00\nrubbish\n")
    with Logs([write("a.log", [0, 1], "can0"), bad]) as logs:
        frames = joined(logs)
        assert frames.channels == ("can0",)
        assert [(part.path.name, part.account.rejected, part.frames) for part in logs.parts] == [
            ("a.log", 0, 2),
            ("bad.log", 1, 1),
        ]
        assert not logs.whole

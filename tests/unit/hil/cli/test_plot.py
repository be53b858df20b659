import argparse
import base64
import json
import re
import zlib

import numpy as np
import pytest
from matplotlib.image import imread

from hil.cli import plot
from hil.errors import BrakebenchError
from hil.report.courses import Course, Courses
from hil.report.courses_page import courses_page

DBC = """VERSION ""
BU_: A
BO_ 1 M: 3 A
 SG_ S : 0|8@1+ (0.5,0) [0|0] "km/h" A
 SG_ R : 16|8@1+ (0.5,0) [0|0] "km/h" A
 SG_ T : 8|7@1+ (1,0) [0|0] "" A
 SG_ B : 15|1@1+ (1,0) [0|0] "" A
VAL_ 1 T 0 "off <b>" 1 "on" 9 "failed" ;
"""


def run(*words):
    parser = argparse.ArgumentParser()
    plot.add_parser(parser.add_subparsers())
    args = parser.parse_args(["plot", *map(str, words)])
    return args.run(args)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "a.log"
    times = [1_700_000_000 + k / 100 + (5 if k >= 200 else 0) for k in range(400)]
    names = [0, 1, 9]
    path.write_text("".join(f"({t:.6f}) can0 001#{k % 100:02X}{names[k // 150]:02X}50\n" for k, t in enumerate(times)))
    (tmp_path / "a.dbc").write_text(DBC)
    return path


def figures_of(page):
    packed = re.search(r'<script type="text/plain" id="data">(.*?)</script>', page, re.DOTALL)[1]
    return json.loads(zlib.decompress(base64.b64decode(packed)))["figures"]


def test_a_page_has_units_names_and_gaps(log, tmp_path, capsys, monkeypatch):
    out = tmp_path / "a.html"
    monkeypatch.setattr("sys.argv", ["brakebench", "plot", str(log)])
    assert run(log, "S", "M.R", "T", "B", "--dbc", tmp_path / "a.dbc", "--out", out) == 0
    assert "4 signals, 1,600 values" in capsys.readouterr().out
    page = out.read_text()
    assert "2023-11-14 22:13:20.000 UTC" in page
    assert "off <b>" not in page
    assert f"<td>brakebench plot {log}</td>" in page  # the command that draws it again
    assert "<h3>M <small>km/h</small></h3>" in page
    speeds, states, bits = figures_of(page)
    assert [trace["name"] for trace in speeds["traces"]] == ["S", "R"]
    assert None in speeds["traces"][0]["y"]  # 5 s of silence are no line
    assert states["traces"][0]["steps"]
    assert states["y"]["names"] == ["off <b>  0", "on  1", "failed  9"]
    assert set(states["traces"][0]["y"]) == {0, 1, 2}
    assert bits["y"]["names"] == ["0", "1"]
    assert set(bits["traces"][0]["y"]) == {0}


def test_a_picture(log, tmp_path):
    out = tmp_path / "a.png"
    assert run(log, "M.*", "--dbc", tmp_path / "a.dbc", "--out", out, "--from", "1") == 0
    picture = imread(out)
    assert picture.shape[1] == 1560
    assert (picture[:, :, :3].min(axis=2) < 0.5).sum() > 5000  # something is drawn on it
    with pytest.raises(BrakebenchError, match="--force"):
        run(log, "M.*", "--dbc", tmp_path / "a.dbc", "--out", out)


def test_what_cannot_be_drawn_is_refused(log, tmp_path):
    with pytest.raises(BrakebenchError, match="no signal"):
        run(log, "Q", "--dbc", tmp_path / "a.dbc", "--out", tmp_path / "a.png")
    with pytest.raises(BrakebenchError, match="plots are written as"):
        run(log, "S", "--dbc", tmp_path / "a.dbc", "--out", tmp_path / "a.txt")
    (tmp_path / "other.log").write_text("(1.0) can0 002#00\n")
    with pytest.raises(BrakebenchError, match=r"no frame of S in it$"):
        run(tmp_path / "other.log", "S", "--dbc", tmp_path / "a.dbc", "--out", tmp_path / "a.png")
    with pytest.raises(BrakebenchError, match="no frame of MODE in it; give the database of this log with --dbc"):
        run(tmp_path / "other.log", "MODE", "--out", tmp_path / "a.png")
    with pytest.raises(BrakebenchError, match="no channel can7; its channels are can0"):
        run(log, "S", "--dbc", tmp_path / "a.dbc", "--channel", "can7", "--out", tmp_path / "a.png")


def test_a_damaged_log_is_drawn_and_told(log, tmp_path, capsys):
    with log.open("a") as file:
        file.write("rubbish\n")
    assert run(log, "S", "--dbc", tmp_path / "a.dbc", "--out", tmp_path / "a.SVG") == 1
    assert "cut off, rejected" in capsys.readouterr().out


def test_many_values_are_thinned_and_the_peak_stays():
    rng = np.random.default_rng(4)
    y = rng.normal(size=500_000)
    y[123_456], y[400_000] = 50.0, -60.0
    course = Course("M.S", np.arange(500_000) / 100, y)
    page = courses_page([Courses((course,), "bar")], "a.log", "1 signal", {})
    trace = figures_of(page)[0]["traces"][0]
    assert len(trace["y"]) <= 20_000
    assert len(page) < 500_000
    assert (max(trace["y"]), min(trace["y"])) == (50.0, -60.0)


def test_gathering_keeps_peaks_in_bounded_memory_everywhere_alike():
    gathered = plot.Gathered(None, np.dtype(np.float64))
    y = np.sin(np.arange(100_000))
    y[50_000] = 9.0
    for begin in range(0, 100_000, 500):
        gathered.add(np.arange(begin, begin + 500), y[begin : begin + 500])
        gathered.thin(5000)
    times, values = gathered.joined()
    assert gathered.count == 100_000
    assert len(times) == gathered.held <= 5000
    assert values.max() == 9.0
    assert (np.diff(times) > 0).all()
    parts = np.histogram(times, 10, (0, 100_000))[0]
    assert parts.min() > 0.5 * parts.max()


def test_many_signals_share_the_memory(log, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(plot, "MOST_SAMPLES", 200)
    held = []
    monkeypatch.setattr(plot, "panels", lambda gathered, _: held.append(gathered) or [])
    monkeypatch.setattr(plot, "courses_page", lambda *_: "")
    assert run(log, "S", "R", "T", "B", "--dbc", tmp_path / "a.dbc", "--out", tmp_path / "a.html") == 0
    assert "4 signals, 1,600 values" in capsys.readouterr().out
    assert 4 * 8 <= sum(one.held for one in held[0].signals.values()) <= 200

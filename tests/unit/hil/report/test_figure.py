from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from hil.report.figure import draw, write_figure
from hil.report.report import Chart, Curve, Event, Lane, Number, Panel, Report, Section, Span, Trace, Verdict


def _texts(figure: Figure) -> str:
    return " ".join(text.get_text() for text in figure.findobj(Text))  # type: ignore[union-attr]


def test_the_picture_shows_names_and_numbers(full_report: Report) -> None:
    figure = draw(full_report)
    text = _texts(figure)
    for name in (
        "A stop",
        "failed",
        "too long",
        "Distance",
        "41.24 m",
        "41.27 %",
        "Speed",
        "km/h",
        "wheel fl",
        "asked",
    ):
        assert name in text
    for name in ("ECU mode", "NORMAL", "bus_off", "Fit", "Slip", "Force", "data", "mass", "radius", "drag"):
        assert name in text
    lines = {line.get_color() for axes in figure.axes for line in axes.lines}
    assert {"#0072B2", "#009E73", "#6E7781"} <= lines


def test_no_number_is_cut_and_none_lies_on_another() -> None:
    numbers = (
        Number("Mean fully developed deceleration", 3.198, "m/s²"),
        Number("Wheel speed to demand p50 / p99 / max", "5.029 / 8.030 / 10.213", "ms"),
        Number("Expected: TRUTH_MOTION.SPEED from 0 s to the end", "6.376 to 13.9", limit="4 to 14.5", met=True),
        *(Number(f"n{k}", float(k)) for k in range(9)),
    )
    reason = (
        "Front pads bite less than they should; these logs cannot tell that from a pressure measured too high. " * 3
    )
    figure = draw(Report("A stop", Verdict.INCONCLUSIVE, reason, numbers))
    texts = [text for text in figure.findobj(Text) if text.get_text()]  # type: ignore[union-attr]
    shown = " ".join(text.get_text() for text in texts)
    for number in numbers:
        assert number.label in shown
    assert "5.029 / 8.030 / 10.213 ms" in shown
    assert "6.376 to 13.9  (4 to 14.5)" in shown
    assert shown.count("pressure measured too high.") == 3
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    boxes = [text.get_window_extent(renderer) for text in texts]
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0 and box.y1 <= figure.bbox.y1 for box in boxes)
    assert not [(i, k) for k, box in enumerate(boxes) for i in range(k) if box.overlaps(boxes[i])]


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_it_is_written_in_the_format_of_the_suffix(full_report: Report, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"report.{suffix}"
    write_figure(full_report, path)
    start = path.read_bytes()[:100]
    assert {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix] in start


@pytest.mark.parametrize("name", ["$x^2", "$\\frac{1}{2}$", "_hidden", "<b>", "\x00\ud800", "摩擦 𓀀", "a\nb", "{%s}"])
def test_any_name_is_drawn_as_it_is(name: str, tmp_path: Path) -> None:
    x = np.array([0.0, 1.0])
    lane = Lane(name, (Span(0.0, 1.0, name),), (Event(0.2, name),))
    traces = (Trace(name, x, x, group="fl"), Trace(name, x, x, "demand"))
    ranked = Chart(name, name, "", name, "", (Curve(name, x + 1.0, x, x, x, "points"),), (name, name))
    section = Section(name, (Panel(name, name, traces),), (lane,), (ranked,))
    report = Report(name, Verdict.PASSED, name, (Number(name, name, name, name, name),), (section,))
    write_figure(report, tmp_path / "r.svg")
    if name.isprintable():
        assert _texts(draw(report)).count(name) >= 9


def test_empty_and_odd_reports_are_drawn(tmp_path: Path) -> None:
    instant = Trace("instant", np.array([3.0]), np.array([1.0]))
    never = Trace("never", np.empty(0), np.empty(0))
    gaps = Trace("gaps", np.array([3.0, 4.0]), np.array([np.nan, np.inf]))
    section = Section(
        "s", (Panel("p", "", (instant, never)), Panel("q", "N", (gaps,)), Panel("none", "")), (Lane("idle"),)
    )
    write_figure(Report(""), tmp_path / "empty.png")
    write_figure(Report("r", sections=(section, Section("nothing"))), tmp_path / "odd.png")
    assert "gaps" not in _texts(draw(Report("r", sections=(section,))))  # one trace needs no legend

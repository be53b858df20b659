import base64
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hil.report.page
from hil.report.html import render_html, write_html
from hil.report.page import scripts
from hil.report.plots import numbers
from hil.report.report import Chart, Curve, Event, Lane, Number, Panel, Report, Section, Span, Table, Trace, Verdict
from hil.report.words import clean

HOSTILE = [
    "<script>alert(1)</script>",
    "</script><script>alert(1)</script>",
    "<!--<script>",
    '"><img src=x onerror=alert(1)>',
    "' onmouseover='alert(1)",
    "<b>bold</b><br><a href='http://example.com'>a</a>",
    "&lt;script&gt; &amp; &#60;b&#62;",
    "%{y} %{customdata[0]} $x^2$",
    "\x00\x1b[31m\u202e\ud800\u2028",
    "{title} %s %(x)s",
]


class Page(HTMLParser):
    """What a browser sees: text, tags with attributes, and scripts apart."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.text: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self._in_script = self._in_word = False
        self.feed(source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "wbr" and not attrs:  # where a word may break
            self._in_word = True
            return
        self.tags.append((tag, dict(attrs)))
        self._in_script = tag == "script"

    def handle_endtag(self, tag: str) -> None:
        self._in_script = False

    def handle_data(self, data: str) -> None:
        into = self.scripts if self._in_script else self.text
        into.append(into.pop() + data if self._in_word else data)
        self._in_word = False

    @property
    def _data(self) -> dict:
        return json.loads(zlib.decompress(base64.b64decode(self.scripts[0])))

    @property
    def figures(self) -> list[dict]:
        return self._data["figures"]

    @property
    def times(self) -> list[list[float]]:
        return self._data["times"]


def page_of(report: Report) -> Page:
    """Parse a page."""
    return Page(render_html(report))


def test_all_content_is_on_the_page(full_report: Report, shown: list[str]) -> None:
    page = page_of(full_report)
    text = re.sub(r"\s+", " ", " ".join(page.text))
    assert [name for name in shown if name not in text and name not in {"Slip", "Force"}] == []
    fit = page.figures[2]
    assert (fit["x"], fit["y"]) == ({"label": "Slip in %", "unit": "%"}, {"label": "Force in N", "unit": "N"})


def test_named_rows_lie_along_the_y_axis_the_first_on_top(full_report: Report) -> None:
    figure = page_of(full_report).figures[3]
    points, asked = figure["traces"]
    assert figure["rows"] == ["mass", "radius", "drag"]
    assert (points["x"], points["y"]) == ([100.0, 200.0, 300.0], [1.0, 2.0, 3.0])
    assert (points["low"], points["high"]) == ([90.0, 180.0, 270.0], [110.0, 220.0, 330.0])
    assert (asked["x"], asked["y"]) == ([150.0, 150.0], [0.5, 3.5])
    assert figure["x"]["label"] == "gain"


def test_every_sample_is_on_the_page_in_the_shown_unit(full_report: Report) -> None:
    page = page_of(full_report)
    for panel, figure in zip(full_report.sections[0].panels, page.figures, strict=False):
        for trace, drawn in zip(panel.traces, figure["traces"], strict=True):
            y = np.array(drawn["y"], dtype=float)  # None becomes NaN: the gap is still there
            np.testing.assert_allclose(y, trace.y * panel.unit.factor, rtol=1e-5)  # type: ignore[union-attr]
            np.testing.assert_allclose(page.times[drawn["x"]], trace.t_s, atol=1e-6)
    assert len(page.times) == 1  # all traces share their times


def test_the_page_needs_no_network(full_report: Report) -> None:
    source = render_html(full_report)
    page = Page(source)
    policy = next(attrs["content"] for tag, attrs in page.tags if attrs.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert not [
        tag for tag, _ in page.tags if tag in {"link", "img", "iframe", "object", "embed", "base", "audio", "video"}
    ]
    assert not [attrs for _, attrs in page.tags if {"src", "href", "srcset", "action", "poster"} & set(attrs)]
    assert source.count("uPlot (v1.6.32)") == source.count("Copyright (c) 2022 Leon Sorokin") == 1
    assert "url(" not in "".join(page.text)
    assert not [script for script in (page.scripts[0], page.scripts[-1]) if "http" in script]


def test_uplot_is_the_published_one() -> None:
    """Digests of the files in the package ``uplot`` 1.6.32 of npm."""
    digests = {
        "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
        "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
        "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
    }
    folder = Path(hil.report.page.__file__).parent / "vendor" / "uplot"
    assert {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()} == digests


def test_what_was_measured_lies_broad_under_what_agrees_with_it() -> None:
    t_s = np.array([0.0, 1.0])
    panel = Panel("p", "", (Trace("measured", t_s, t_s, "measured"), Trace("extended", t_s, t_s, group="fl")))
    measured, extended = page_of(Report("r", sections=(Section("s", (panel,)),))).figures[0]["traces"]
    assert measured["width"] > 2 * extended["width"]


def test_no_script_ends_within_itself() -> None:
    assert not [text for text in scripts() if re.search("</script|<!--", text, re.IGNORECASE)]


def _everything_named(name: str) -> Report:
    x = np.array([0.0, 1.0])
    panel = Panel(name, name, (Trace(name, x, x, group=name),), (name, name))
    lane = Lane(name, (Span(0.0, 0.5, name),), (Event(0.7, name),))
    chart = Chart(name, name, name, name, name, (Curve(name, x, x, x, x),))
    ranked = Chart(name, name, name, name, name, (Curve(name, x + 1.0, x, x, x, "points"),), (name, name))
    section = Section(name, (panel,), (lane,), (chart, ranked), (Table(name, (name,), ((name,),), name),), name)
    numbers = (Number(name, name, name, name, name, False),)
    return Report(name, Verdict.FAILED, name, numbers, (section,), {name: {name: name}, "list": [name]})


def _harmless(name: str) -> None:
    expected = [(tag, sorted(attrs)) for tag, attrs in page_of(_everything_named("x" * len(name))).tags]
    page = page_of(_everything_named(name))
    assert [(tag, sorted(attrs)) for tag, attrs in page.tags] == expected  # no tag, no attribute of its own
    assert len(page.scripts) == 3
    shown = clean(name)
    panel, chart, ranked = page.figures
    assert [figure["traces"][0]["name"] for figure in page.figures] == [shown] * 3
    assert (panel["y"]["names"], ranked["rows"]) == ([shown] * 2, [shown] * 2)
    assert chart["x"] == {"label": f"{shown} in {shown}", "unit": shown}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_stay_text(name: str) -> None:
    _harmless(name)


@settings(max_examples=60)
@given(st.text(st.sampled_from("<>&\"'/%${}!-=;#abscript\\\n\x00\u2028\ud800é"), min_size=1, max_size=30))
def test_any_name_stays_text(name: str) -> None:
    _harmless(name)


def test_our_script_writes_names_as_text_only() -> None:
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function", scripts()[1])


@pytest.mark.parametrize("report", [Report(""), Report("r", sections=(Section("nothing"),))])
def test_an_empty_report_is_a_page(report: Report) -> None:
    source = render_html(report)
    assert len(source) < 40_000
    assert Page(source).figures == []


def test_odd_traces_are_drawn() -> None:
    instant = Trace("instant", np.array([3.0]), np.array([np.inf]))
    never = Trace("never", np.empty(0), np.empty(0))
    missing = Trace("missing", np.array([3.0]), np.array([np.nan]))
    lane = Lane("l", (Span(3.0, 3.0, "a blink"),), (Event(3.0, "now"),))
    page = page_of(Report("r", sections=(Section("s", (Panel("p", "", (instant, never, missing)),), (lane,)),)))
    figure = page.figures[0]
    assert [trace["y"] for trace in figure["traces"]] == [[None], [], [None]]
    assert figure["x"]["range"] == [2.5, 3.5]


def test_numbers_keep_six_digits() -> None:
    values = np.array([0.0, -1.23456789e-9, 123456789.0, np.nan, -np.inf, 1e300, 5e-324])
    assert numbers(values) == [
        0.0,
        pytest.approx(-1.23457e-9),
        123457000.0,
        None,
        None,
        pytest.approx(1e300),
        pytest.approx(0, abs=1e-300),
    ]


def test_a_huge_trace_is_thinned_and_the_page_says_so(full_report: Report) -> None:
    t_s = np.arange(1_000_000) * 1e-3
    y = np.sin(t_s)
    y[500_001] = 9.0
    page = page_of(Report("r", sections=(Section("s", (Panel("Force", "N", (Trace("f", t_s, y),)),)),)))
    drawn = page.figures[0]["traces"][0]
    assert len(drawn["y"]) == len(page.times[0]) <= 20_000
    assert max(drawn["y"]) == 9.0
    assert f"Force / f: {len(drawn['y'])} of 1000000" in "".join(page.text)
    assert "fewer samples" not in "".join(page_of(full_report).text)


def test_sixty_traces_of_ten_seconds_stay_below_a_megabyte(tmp_path: Path) -> None:
    t_s = np.arange(0.0, 10.0, 0.01)
    noise = np.random.default_rng(1).normal(size=(60, t_s.size))
    panels = tuple(
        Panel(f"p{i}", "N", tuple(Trace(f"{i}.{k}", t_s, noise[6 * i + k]) for k in range(6))) for i in range(10)
    )
    path = tmp_path / "report.html"
    write_html(Report("r", sections=(Section("s", panels),)), path)
    assert path.stat().st_size < 1e6


def test_the_time_axes_of_a_section_have_one_range(full_report: Report) -> None:
    page = page_of(full_report)
    assert [figure["x"]["range"] for figure in page.figures[:2]] == [[0.0, 2.0], [0.0, 2.0]]
    linked = [attrs for tag, attrs in page.tags if tag == "div" and attrs.get("class") == "linked"]
    assert [(a["data-start"], a["data-end"]) for a in linked] == [("0.0", "2.0")]

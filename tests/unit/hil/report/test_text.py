import io
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.report.report import Event, Lane, Number, Panel, Report, Section, Table, Trace, Verdict
from hil.report.text import MOST_EVENTS, print_text, render_text


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("width", [60, 80, 120])
def test_all_content_is_there_and_no_line_is_wider_than_asked(
    full_report: Report, shown: list[str], width: int
) -> None:
    text = render_text(full_report, width)
    flat = re.sub(r"\s+", " ", text)
    assert [name for name in shown if name not in flat] == []
    assert max(map(len, text.splitlines())) <= width
    assert "\x1b" not in text


def test_missed_limits_and_the_verdict_stand_out(full_report: Report) -> None:
    text = render_text(full_report, 80)
    assert text.splitlines()[1] == "FAILED  too long"
    assert re.search(r"Distance +41\.24  m  +≤ 40  ✗", text)
    assert re.search(r"Load +41\.27  %  +≤ 50  ✓", text)
    coloured = render_text(full_report, 80, colour=True)
    assert "\x1b[1;31mFAILED\x1b[0m" in coloured
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == text


def test_the_brief_form_keeps_numbers_and_timeline_but_no_courses(full_report: Report) -> None:
    text = render_text(full_report, 80, brief=True)
    assert "41.24" in text
    assert "bus_off" in text
    assert "p rear" not in text
    assert "stop72.toml" not in text


def test_colour_only_on_a_terminal_that_wants_it(full_report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    tty, pipe = Terminal(), io.StringIO()
    print_text(full_report, tty)
    print_text(full_report, pipe)
    assert "\x1b[" in tty.getvalue()
    assert "\x1b" not in pipe.getvalue()
    monkeypatch.setenv("NO_COLOR", "1")
    quiet = Terminal()
    print_text(full_report, quiet)
    assert "\x1b" not in quiet.getvalue()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_any_stream_encoding_takes_it(full_report: Report, encoding: str) -> None:
    raw = io.BytesIO()
    with io.TextIOWrapper(raw, encoding=encoding) as stream:
        print_text(full_report, stream)
        text = raw.getvalue().decode(encoding)
    assert "41.24" in text
    assert "wheel fl" in text
    assert ("<= 40" in text) == (encoding != "utf-8")


def test_a_gap_is_blank_and_a_course_follows_the_panel_scale() -> None:
    t_s = np.arange(0.0, 8.0, 0.01)
    steps = np.where((t_s > 2.0) & (t_s < 6.0), np.nan, (t_s > 4.0) * 10.0)
    section = Section("s", (Panel("p", "", (Trace("steps", t_s, steps), Trace("half", t_s, np.full(t_s.size, 5.0)))),))
    lines = render_text(Report("r", sections=(section,)), 80).splitlines()
    course = next(line for line in lines if "steps" in line)
    assert re.search(r"▁+ +█+$", course)
    assert set(next(line for line in lines if "half" in line).split()[-1]) == {"▅"}


def test_several_values_in_one_have_their_unit() -> None:
    text = render_text(Report("r", numbers=(Number("Lateness p50 / max", "0.047 / 3.060", "ms", "worse node"),)))
    assert "Lateness p50 / max  0.047 / 3.060 ms" in text


def test_empty_and_odd_reports_print() -> None:
    assert render_text(Report("")) == "\n"
    one = Trace("instant", np.array([3.0]), np.array([1.0]))
    none = Trace("never", np.empty(0), np.empty(0))
    missing = Trace("missing", np.array([3.0]), np.array([np.nan]))
    section = Section("s", (Panel("p", "", (one, none, missing)), Panel("no traces", "m")), (Lane("idle"),))
    tables = Section("t", tables=(Table("", ()), Table("none", ("a", "b"))))
    text = render_text(Report("r", Verdict.INCOMPLETE, sections=(section, tables)))
    for name in ("INCOMPLETE", "instant", "never", "missing", "no traces", "idle"):
        assert name in text


def test_many_events_are_counted_not_hidden() -> None:
    events = tuple(Event(0.1 * i, f"event {i}") for i in range(500))
    text = render_text(Report("r", sections=(Section("s", timeline=(Lane("link", events=events),)),)))
    assert f"{500 - MOST_EVENTS} more of 500" in text


def test_a_chart_with_named_rows_is_a_table_of_its_points(full_report: Report) -> None:
    text = render_text(full_report, 100)
    lines = text[text.index("Candidates") :].splitlines()
    assert [line.split() for line in lines[1:5]] == [
        ["candidate", "gain"],
        ["mass", "100.0"],
        ["radius", "200.0"],
        ["drag", "300.0"],
    ]


def test_a_table_too_wide_is_printed_cell_by_cell() -> None:
    table = Table("T", tuple(f"column {i}" for i in range(12)), (tuple(range(1000, 1012)),))
    text = render_text(Report("r", sections=(Section("s", tables=(table,)),)), 60)
    assert "column 11: 1011" in text
    assert max(map(len, text.splitlines())) <= 60


@given(st.text(), st.text(), st.text())
def test_no_name_breaks_the_layout_or_reaches_the_terminal(title: str, label: str, unit: str) -> None:
    trace = Trace(label, np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    lane = Lane(label, events=(Event(0.5, title),))
    section = Section(title, (Panel(label, unit, (trace,)),), (lane,), tables=(Table(title, (label,), ((unit,),)),))
    text = render_text(Report(title, numbers=(Number(label, title, unit, unit, label),), sections=(section,)))
    assert not [c for c in text if c != "\n" and (ord(c) < 32 or 127 <= ord(c) < 160)]

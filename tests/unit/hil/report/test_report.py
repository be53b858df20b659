import numpy as np
import pytest

from hil.report.palette import INK, NEUTRAL, SERIES, WHEEL_COLOURS, strokes
from hil.report.report import Chart, Curve, Event, Lane, Panel, Section, Span, Table, Trace
from hil.report.units import BAR, DEG_C, KMH, shown, symbol


def test_a_trace_takes_any_sequence_and_keeps_float64_vectors() -> None:
    trace = Trace("v", [0, 1, 2], (3, 4, 5))  # type: ignore[arg-type]
    assert trace.t_s.dtype == trace.y.dtype == np.float64
    assert trace.y.tolist() == [3.0, 4.0, 5.0]


@pytest.mark.parametrize(
    ("t_s", "y", "message"),
    [
        ([0.0, 1.0], [1.0], r"trace 'v': expected .* equal length, got shapes .*\(2,\).*\(1,\)"),
        ([[0.0]], [[1.0]], "one-dimensional"),
        ([0.0, np.nan], [1.0, 2.0], "leave a gap as NaN in y"),
        ([0.0, 2.0, 1.0], [1.0, 2.0, 3.0], r"sample 2 \(1 s\) is before sample 1 \(2 s\); sort it"),
    ],
)
def test_a_bad_trace_is_refused_with_its_name(t_s: list[float], y: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Trace("v", np.array(t_s), np.array(y))


def test_bad_curves_tables_spans_and_events_are_refused() -> None:
    one = np.ones(3)
    with pytest.raises(ValueError, match="curve 'c': expected both low and high"):
        Curve("c", one, one, low=one)
    with pytest.raises(ValueError, match=r"curve 'c': expected .* equal length"):
        Curve("c", one, one, np.ones(2), np.ones(2))
    with pytest.raises(ValueError, match="table 'T', row 1: expected 2 cells, one per column, got 1"):
        Table("T", ("a", "b"), ((1, 2), (3,)))
    with pytest.raises(ValueError, match="span 'INIT': expected finite start <= end, got 2"):
        Span(2.0, 1.0, "INIT")
    with pytest.raises(ValueError, match="event 'x': expected a finite time"):
        Event(float("inf"), "x")


def test_the_time_range_covers_traces_spans_and_events() -> None:
    trace = Trace("v", np.array([1.0, 2.0]), np.zeros(2))
    empty = Trace("none", np.empty(0), np.empty(0))
    lane = Lane("l", (Span(0.5, 1.0, "a"),), (Event(3.0, "b"),))
    section = Section("s", (Panel("p", "", (empty, trace)),), (lane,))
    assert section.time_range_s() == (0.5, 3.0)
    assert Section("s", (Panel("p", "", (empty,)),)).time_range_s() is None
    assert [(name, span.start_s) for name, span in section.happenings()] == [("l", 0.5), ("l", 3.0)]


def test_spans_that_overlap_and_events_get_rows_of_their_own() -> None:
    a, b, c = Span(0.0, 2.0, "a"), Span(1.0, 3.0, "b"), Span(2.0, 4.0, "c")
    event = Event(1.5, "e")
    rows = Lane("faults", (c, b, a), (event,)).rows()
    assert [(row.name, row.spans, row.events) for row in rows] == [
        ("faults", (a, c), ()),
        ("", (b,), ()),
        ("", (), (event,)),
    ]
    assert Lane("idle").rows() == (Lane("idle"),)
    assert Section("s", timeline=(Lane("one", (a,)), Lane("two", (b,)))).rows() == (
        Lane("one", (a,)),
        Lane("two", (b,)),
    )


def test_si_values_are_converted_and_text_units_are_not() -> None:
    values = np.array([1.0, 300.0])
    assert shown(values, KMH).tolist() == [3.6, 1080.0]
    np.testing.assert_allclose(shown(values * 1e5, BAR), values, rtol=1e-15)
    np.testing.assert_allclose(shown(values, DEG_C), [-272.15, 26.85], rtol=1e-12)
    assert shown(values, "km/h") is values
    assert (symbol(KMH), symbol("N")) == ("km/h", "N")


def test_wheels_keep_their_colour_demands_are_neutral_dashes_and_groups_share_one() -> None:
    x = np.zeros(1)

    def colours(*traces: Trace) -> list[str]:
        return [stroke.colour for stroke in strokes(traces)]

    rr, car = Trace("a", x, x, group="rr"), Trace("b", x, x)
    assert colours(car, rr) == [INK, WHEEL_COLOURS["rr"]]
    assert colours(car, car)[0] == SERIES[0]
    assert len(set(colours(*(Trace(str(i), x, x) for i in range(8))))) == 8
    true, estimated = strokes([Trace("t", x, x, group="pad"), Trace("e", x, x, "estimate", "pad")])
    assert true.colour == estimated.colour
    assert estimated.dash
    assert not true.dash
    front, rear = strokes([Trace("f", x, x, "demand", "fl"), Trace("r", x, x, "demand", "rl")])
    assert front.colour == rear.colour == NEUTRAL
    assert front.dash != rear.dash


def test_points_beside_the_named_rows_are_refused() -> None:
    points = Curve("gain", np.array([0.0, 1.0]), np.array([1.0, 2.0]), style="points")
    with pytest.raises(
        ValueError, match=r"chart 'c', points 'gain': expected x from 1 to 2, .* number the rows from 1"
    ):
        Chart("c", "", "", "", "", (points,), ("a", "b"))


def test_a_band_over_named_rows_is_refused() -> None:
    x = np.array([1.0, 2.0])
    with pytest.raises(ValueError, match=r"chart 'c', line 'asked': expected no interval .* draw it as points"):
        Chart("c", "", "", "", "", (Curve("asked", x, x, x, x),), ("a", "b"))

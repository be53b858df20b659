"""A report with one of everything."""

import numpy as np
import pytest

from hil.report.report import (
    Chart,
    Curve,
    Event,
    Lane,
    Number,
    Panel,
    Report,
    Section,
    Span,
    Table,
    Trace,
    Verdict,
)
from hil.report.units import BAR, KMH, PERCENT


@pytest.fixture
def full_report() -> Report:
    t_s = np.arange(0.0, 2.0, 0.01)
    gap = np.where((t_s > 0.5) & (t_s < 0.7), np.nan, 1e5 * t_s)
    speed = Panel(
        "Speed", KMH, (Trace("vehicle", t_s, 20.0 - 5.0 * t_s), Trace("wheel fl", t_s, 20.0 - t_s, group="fl"))
    )
    pressure = Panel("Pressure", BAR, (Trace("p rear", t_s, gap, group="rl"), Trace("asked", t_s, 1e5 * t_s, "demand")))
    lanes = (
        Lane("ECU mode", (Span(0.0, 0.25, "INIT"), Span(0.25, 2.0, "NORMAL", "ok"))),
        Lane("Link", events=(Event(1.25, "bus_off", "error"),)),
    )
    x = np.array([1.0, 2.0, 3.0])
    chart = Chart(
        "Fit",
        "Slip",
        PERCENT,
        "Force",
        "N",
        (Curve("model", x, x * 2, x, x * 3), Curve("data", x, x, x - 1, x + 1, "points")),
    )
    points = Curve("gain", x, 100.0 * x, 90.0 * x, 110.0 * x, "points")
    asked = Curve("asked", np.array([0.5, 3.5]), np.full(2, 150.0), style="demand")
    ranked = Chart("Candidates", "candidate", "", "gain", "", (points, asked), ("mass", "radius", "drag"))
    table = Table("Rates", ("message", "rate, Hz"), (("BRAKE_PEDAL", 100.25), ("STEERING", None)), "as received")
    return Report(
        title="A stop",
        verdict=Verdict.FAILED,
        reason="too long",
        numbers=(
            Number("Distance", 41.237, "m", "from pedal contact", "≤ 40", False),
            Number("Load", 0.4127, PERCENT, limit="≤ 50", met=True),
            Number("Frames", 15873),
            Number("Lost", float("nan"), "frames"),
            Number("Log", "runs/a.log"),
        ),
        sections=(
            Section("Braking", (speed, pressure), lanes, text="On a dry road."),
            Section("Study", charts=(chart, ranked), tables=(table,)),
        ),
        provenance={"scenario": {"file": "stop72.toml", "mu": 0.123456789}, "seeds": [1, 7], "python": "3.11"},
    )


# What each printer must show of it.
NAMES = [
    "A stop",
    "too long",
    "Distance",
    "from pedal contact",
    "≤ 40",
    "Frames",
    "Log",
    "runs/a.log",
    "Braking",
    "On a dry road",
    "Speed",
    "vehicle",
    "wheel fl",
    "Pressure",
    "p rear",
    "asked",
    "ECU mode",
    "INIT",
    "NORMAL",
    "Link",
    "bus_off",
    "Study",
    "Fit",
    "Slip",
    "Force",
    "model",
    "data",
    "Rates",
    "message",
    "BRAKE_PEDAL",
    "as received",
]
NUMBERS = ["41.24", "41.27", "15873", "100.2", "km/h", "bar", "0.250", "1.250"]
PROVENANCE = ["scenario", "stop72.toml", "0.123456789", "1, 7", "3.11"]


@pytest.fixture
def shown() -> list[str]:
    """Every name and number of the full report as a reader sees it."""
    return NAMES + NUMBERS + PROVENANCE

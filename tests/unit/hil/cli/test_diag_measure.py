"""What `diag measure` makes of periodic frames; that they come is shown with real processes (docs/diagnose-it.md)."""

import math
import struct

import pytest

from ecu.diagnostics.quantities import QUANTITIES
from hil.cli.diag_measure import _facts, _write
from hil.uds.own import OWN, sample_of

LOWS = {one.name: k for k, one in enumerate(QUANTITIES)}


def frames(name, ticks, values):
    """Samples as they come from the bus: a little late, and padded."""
    packed = [struct.pack(">BBf", LOWS[name], t & 0xFF, v) + b"\xcc\xcc" for t, v in zip(ticks, values, strict=True)]
    return [(10_000_000 * t + 3_000_000 * (t % 2), sample_of(data)) for t, data in zip(ticks, packed, strict=True)]


def test_a_frame_is_a_sample():
    (_, sample), *_ = frames("speed", [300], [14.5])
    assert sample == ("speed", 300 & 0xFF, 14.5)
    assert sample_of(b"\xf0" + bytes(7)) is None
    assert sample_of(bytes(5)) is None
    assert OWN.periodic_text(struct.pack(">BBf", LOWS["speed"], 7, 14.5) + b"\xcc\xcc") == (
        "periodic data, 0xF206 speed = 14.5 m/s"
    )


def test_missing_values_are_told_by_the_tick_number():
    ticks = [250, 251, 254, 255, 256, 260]
    facts = _facts(frames("speed", ticks, [1.0, 2.0, math.nan, 3.0, 4.0, 5.0]), step=1)
    assert facts == {"samples": 6, "missing": 5, "least": 1.0, "greatest": 5.0, "mean": 3.0}
    assert _facts(frames("speed", [0, 10, 30], [1.0] * 3), step=10)["missing"] == 1
    assert _facts(frames("speed", [40, 140, 440], [1.0] * 3), step=100)["missing"] == 2  # more than a round of the byte
    assert _facts(frames("speed", [0, 1, 600], [1.0] * 3), step=1)["missing"] == 598
    assert math.isnan(_facts(frames("speed", [1], [math.nan]), step=1)["mean"])


def test_a_row_is_a_tick_of_the_law_over_a_long_time(tmp_path):
    ticks = [t for t in range(200, 1200) if t not in (300, 301, 302)]
    both = sorted(
        frames("speed", ticks, ticks) + frames("mode", ticks[::2], [1.0] * len(ticks[::2])), key=lambda x: x[0]
    )
    _write(tmp_path / "a.csv", ["speed", "mode"], both)
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert head == "time_s,speed,mode"
    assert len(rows) == len(ticks)
    for row, tick in zip(rows, ticks, strict=True):
        time_s, speed, _ = row.split(",")
        assert float(time_s) == pytest.approx((tick - 200) * 0.01)
        assert float(speed) == tick
    assert sum(row.endswith(",") for row in rows) == len(ticks) // 2

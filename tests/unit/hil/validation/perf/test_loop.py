"""What the comparisons of speed compare: both sides do the same."""

import pytest

from dbc.contract import contract
from dbc.frame import BusName
from hil.validation.perf import codec, loop
from hil.validation.perf.cantools_codec import cantools_spec


def test_both_loops_send_the_same_frames():
    until_ns = 600_000_000
    ours = [frame[:3] for frame in loop.our_loop(until_ns)]
    theirs = [frame[:3] for frame in loop.other_loop(until_ns)]
    assert len(ours) > 1000
    assert ours == theirs


def test_the_codec_rows_are_of_the_same_bytes_and_values():
    for can_id, frames in codec.payloads().items():
        spec = contract(BusName.VEHICLE).by_id[can_id]
        theirs = cantools_spec(spec.type)
        assert len(frames) > 3
        for data in frames:
            message = spec.decode(data)
            assert theirs.decode(data) == message
            assert theirs.encode(message) == spec.encode(message)


def test_rows_of_the_loop(monkeypatch):
    monkeypatch.setattr(loop, "SIMULATED_S", 0.3)
    monkeypatch.setattr(loop, "PAIRS", 1)
    whole, *parts, factor = loop.measure()
    assert whole.ours == pytest.approx(sum(row.ours for row in parts))
    assert whole.other == pytest.approx(sum(row.other for row in parts))
    assert factor.ours == pytest.approx(1e4 / whole.ours)
    assert all(row.ratio > 0.0 for row in (whole, *parts))

"""What the comparisons of speed compare: both sides do the same."""

from pathlib import Path

import pytest

from dbc.contract import contract
from dbc.frame import BusName
from hil.cli.main import main
from hil.errors import BrakebenchError
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


@pytest.mark.slow
def test_beside_the_same_checkout_nothing_is_gained(monkeypatch):
    monkeypatch.setattr(loop, "BESIDE_PAIRS", 5)
    (row,) = loop.beside(str(Path(loop.__file__).parents[3]))
    assert row.unit == "us"
    assert 0.5 < row.ratio < 2.0  # of processor time


def test_beside_what_is_no_checkout(tmp_path, capsys):
    with pytest.raises(BrakebenchError, match="expected a checkout of the project"):
        loop.beside(str(tmp_path))
    assert main(["perf", "codec", "--beside", str(tmp_path)]) == 2
    assert "--beside goes with perf loop" in capsys.readouterr().err

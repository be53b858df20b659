import numpy as np
import pytest

from dbc.database import parse_database
from hil.errors import BrakebenchError
from hil.log.export.blocks import Block, Field
from hil.log.export.resample import MAX_ROWS, raster_rows, resampled

SIGNAL = next(
    iter(parse_database('VERSION ""\nBU_: A\nBO_ 1 M: 1 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" A\n').messages.values())
).signals[0]
FIELD = Field("M", SIGNAL, np.dtype(np.int64))


def blocks(times, values, cuts):
    times, values = np.array(times, np.int64), np.array(values, np.int64)
    for a, b in zip([0, *cuts], [*cuts, len(times)], strict=True):
        rows = np.arange(b - a)
        yield Block(times[a:b], None, (), {"M.S": (rows, values[a:b])}, {"M": rows})


def raster(parts, begin, end, step):
    times, values = [], []
    for block in resampled(parts, [FIELD], begin, end, step):
        dense = np.full(len(block), -1)
        if "M.S" in block.columns:
            rows, found = block.columns["M.S"]
            dense[rows] = found
        times += block.time_ns.tolist()
        values += dense.tolist()
    return times, values


def test_a_value_holds_until_the_next_one_wherever_the_log_is_cut():
    rng = np.random.default_rng(2)
    times = np.sort(rng.integers(0, 1000, 200))
    expected_times = list(range(0, 1001, 7))
    place = np.searchsorted(times, expected_times, "right")
    expected = [-1 if p == 0 else int(p - 1) for p in place]
    for cuts in ([], [1], [50, 51, 120], list(range(1, 200))):
        assert raster(blocks(times, np.arange(200), cuts), 0, 1000, 7) == (expected_times, expected)


def test_a_frame_at_the_very_time_of_a_row_counts():
    assert raster(blocks([0, 10, 10, 20], [1, 2, 3, 4], [2]), 0, 20, 10) == ([0, 10, 20], [1, 3, 4])


def test_stamps_running_back_lose_no_row():
    times, values = raster(blocks([0, 30, 10, 40], [1, 2, 3, 4], [2]), 0, 40, 10)
    assert times == [0, 10, 20, 30, 40]
    assert values[0] == 1
    assert values[-1] == 4


def test_too_many_rows_are_refused():
    assert raster_rows(0, 100, 10) == 11
    with pytest.raises(BrakebenchError, match="choose a longer step"):
        raster_rows(0, MAX_ROWS + 1, 1)

"""The example's RAV4 messages and their sum, against a real car's log."""

import csv
from pathlib import Path

import numpy as np
import pytest

from hil.gateway.database import load
from hil.gateway.protection import ToyotaSum
from hil.gateway.signals import physical, read

EXAMPLE = Path(__file__).parents[2] / "examples" / "rav4_brake.dbc"
WITH_SUM = (0x024, 0x025, 0x0B4, 0x1D3, 0x260)  # of this log; WHEEL_SPEEDS has none


@pytest.fixture(scope="module")
def frames(measured_data):
    """Time, identifier and payload of the first ten seconds."""
    found = []
    with (measured_data / "rav4" / "bus0.log").open() as log:
        for line in log:
            stamp, _, frame = line.split()
            can_id, data = frame.split("#")
            found.append((float(stamp[1:-1]), int(can_id, 16), bytes.fromhex(data)))
            if found[-1][0] > found[0][0] + 10.0:
                return found
    return found


@pytest.mark.parametrize("can_id", WITH_SUM)
def test_every_frame_of_the_car_has_the_sum(frames, can_id):
    payloads = [data for _, one, data in frames if one == can_id]
    assert len(payloads) > 300
    assert all(ToyotaSum(can_id).sound(data) for data in payloads)


def test_wheel_speeds_are_the_references(frames, measured_data):
    signals = {s.name: s for s in load(EXAMPLE).messages["WHEEL_SPEEDS"].signals}
    wheels = [signals[f"WHEEL_SPEED_{wheel}"] for wheel in ("FL", "FR", "RL", "RR")]
    with (measured_data / "rav4" / "reference_wheel_speed.csv").open() as file:
        reference = {row["t_s"]: row for row in csv.DictReader(file)}
    compared = 0
    for stamp, can_id, data in frames:
        row = reference.get(f"{stamp:.6f}")
        if can_id == 0x0AA and row is not None:
            mine = [physical(signal, read(signal, data)) / 3.6 for signal in wheels]
            assert np.allclose(mine, [float(row[f"{w}_mps"]) for w in ("fl", "fr", "rl", "rr")], atol=2e-6)
            compared += 1
    assert compared > 300

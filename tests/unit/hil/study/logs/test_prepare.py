"""Logs into replays: demands that the measurement contradicts are left out."""

import numpy as np
import pytest

from hil.study.logs.prepare import prepare
from hil.study.logs.table import Log, make_log

WHEELS = ("fl", "fr", "rl", "rr")


def _log(asked: float, given: float) -> Log:
    """Ten seconds at 20 m/s with a braking pressure in the middle of it."""
    t = np.arange(1000) * 0.01
    braking = (t > 3.0) & (t < 6.0)
    channels = {f"wheel_speed_{w}_rad_s": np.full(1000, 60.0) for w in WHEELS}
    channels |= {f"pressure_{w}_pa": given * braking for w in WHEELS}
    channels |= {f"pressure_demand_{w}_pa": asked * braking for w in WHEELS}
    return make_log("log", t, channels)


@pytest.mark.parametrize(("asked", "kept"), [(20e5, True), (0.0, False)])
def test_demands_that_nobody_followed_are_left_out(asked: float, kept: bool) -> None:
    case = prepare([_log(20e5, 20e5), _log(asked, 20e5)], 0.3)
    assert ("pressure" in case.groups) is kept
    for drive in case.drives:
        assert drive.log.has("pressure_demand_fl_pa") is kept
        assert any("demands left out" in text for text in drive.log.remarks) is not kept
    assert [drive.number for drive in case.drives] == [0, 1]


def test_released_brakes_contradict_nothing() -> None:
    assert "pressure" in prepare([_log(0.0, 0.0)], 0.3).groups

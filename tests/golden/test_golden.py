"""The golden run: what changed without anybody meaning it to."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

SPEC = importlib.util.spec_from_file_location("regenerate", Path(__file__).with_name("regenerate.py"))
golden = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(golden)


@pytest.fixture(scope="module")
def signals():
    return golden.golden_signals()


def test_every_signal_is_as_stored_within_one_step(signals):
    moved = golden.differences(golden.raw_values(signals), golden.stored())
    beyond = {name: lsb for name, lsb in moved.items() if lsb > 1.0}
    print(f"{len(moved)} signals moved by one step on this processor")
    assert not beyond, f"{beyond}: if this was meant, run python {golden.HERE / 'regenerate.py'} and commit the result"


def test_the_golden_run_sees_all_that_matters(signals):
    assert golden.STORED.stat().st_size < 300_000
    assert set(signals.get("BRAKE_STATUS.MODE")[1]) >= {1.0, 2.0}
    assert 8.0 < signals.get("TRUTH_MOTION.SPEED")[1][-1] < 13.0
    assert signals.get("TRUTH_ENERGY.RECUPERATED")[1][-1] > 5e3
    assert signals.get("BATTERY_STATUS.CHARGE_POWER_LIMIT")[1].min() == 0.0
    assert signals.get("MOTOR_STATUS_FRONT.FAULT_FL")[1].max() == 2.0


def test_differences_are_found():
    a = {"A": np.array([1, 2, 3]), "B": np.array([1]), "C": np.array([1])}
    b = {"A": np.array([1, 4, 3]), "B": np.array([1, 1]), "D": np.array([1])}
    assert golden.differences(a, b) == {"A": 2.0, "B": np.inf, "C": np.inf, "D": np.inf}
    assert golden.differences(a, a) == {}

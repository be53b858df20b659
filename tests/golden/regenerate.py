"""The golden run: every signal of one scenario as it was when this was last run, in steps of its wire (LSB).

    python tests/golden/regenerate.py

Run it when plant, controller or contract have changed on purpose, look at what it says has moved, commit the result.
"""

from pathlib import Path

import numpy as np

from hil.bench.result import Signals
from hil.bench.virtual import simulate
from hil.scenario.scenario import load_scenario

HERE = Path(__file__).parent
STORED = HERE / "golden.npz"


def golden_signals() -> Signals:
    """The golden scenario in virtual time."""
    return simulate(load_scenario(str(HERE / "golden.toml")))


def raw_values(signals: Signals) -> dict[str, np.ndarray]:
    """Raw value of each sample by ``MESSAGE.SIGNAL``; check values apart, which any step of a signal turns over."""
    raw = {}
    for name, column in signals.decoded.columns.items():
        if not name.endswith(".CRC"):
            factor, offset = float(column.signal.factor), float(column.signal.offset)
            steps = np.round((np.asarray(column.values, np.float64) - offset) / factor)
            raw[name] = steps.astype(np.int32)
    return raw


def differences(now: dict[str, np.ndarray], then: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest difference in LSB of each signal that moved; infinite where it came, went or has another length."""
    moved = {}
    for name in sorted(now.keys() | then.keys()):
        a, b = now.get(name), then.get(name)
        if a is None or b is None or len(a) != len(b):
            moved[name] = float("inf")
        elif len(a) and np.any(a != b):
            moved[name] = float(np.abs(a.astype(np.int64) - b).max())
    return moved


def stored() -> dict[str, np.ndarray]:
    """The golden run as committed; it holds steps from sample to sample, which compress well."""
    with np.load(STORED) as file:
        return {name: np.cumsum(file[name], dtype=np.int32) for name in file.files}


def main() -> None:
    """Write the golden run anew and say what moved."""
    now = raw_values(golden_signals())
    moved = differences(now, stored()) if STORED.exists() else {}
    np.savez_compressed(STORED, **{name: np.diff(values, prepend=0) for name, values in now.items()})
    for name, lsb in sorted(moved.items(), key=lambda item: -item[1]):
        print(f"{name:48} {lsb:10.0f} LSB")
    print(f"{len(moved)} of {len(now)} signals moved; {STORED.stat().st_size / 1e3:.0f} kB written to {STORED}")


if __name__ == "__main__":
    main()

"""Expectations: what a run must reach to pass. Takes tables of a scenario, gives limits of results and of signals."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from dbc.contract import contract
from dbc.frame import BusName
from hil.scenario.table import ScenarioError, Table

LONGEST_S = 3600.0
"""Longest duration of a manoeuvre."""
EXPECTABLE = (
    "stop_distance_m",
    "stop_time_s",
    "mean_decel_mps2",
    "energy_recuperated_j",
    "frames_lost",
    "frames_corrupt",
    "overruns",
)


@dataclass(frozen=True, slots=True)
class Expectation:
    """What a result must lie between; ``name`` is a key of ``run --json``."""

    name: str
    minimum: float
    maximum: float


@dataclass(frozen=True, slots=True)
class SignalExpectation:
    """Limits of every sample of a signal, SI, between two times of the manoeuvre."""

    signal: str
    from_s: float
    to_s: float
    minimum: float
    maximum: float

    @property
    def name(self) -> str:
        """What is expected of what, for people."""
        until = "the end" if self.to_s >= LONGEST_S else f"{self.to_s:g} s"
        return f"{self.signal} from {self.from_s:g} s to {until}"


def read_expectations(table: Table) -> Iterator[Expectation]:
    """Of the table ``[expect]``: limits of the results named in `EXPECTABLE`."""
    for name in EXPECTABLE:
        limits = table.table(name)
        low, high = _limits(limits)
        if math.isfinite(low) or math.isfinite(high):
            yield Expectation(name, low, high)
    table.done()


def _limits(table: Table) -> tuple[float, float]:
    low, high = table.number("min", -math.inf), table.number("max", math.inf)
    table.done()
    return low, high


def read_signal_expectation(table: Table) -> SignalExpectation:
    """Of a table ``[[expect_signal]]``: MESSAGE.SIGNAL of either bus, and ``min``, ``max`` or both."""
    known = {f"{s.name}.{f.signal}" for bus in BusName for s in contract(bus).by_id.values() for f in s.fields}
    name = table.text("signal")
    if name not in known:
        near = get_close_matches(name, sorted(known), 3) or ["MESSAGE.SIGNAL of brake.dbc or bench.dbc"]
        raise ScenarioError(f"{table.at('signal')}: no signal {name!r}; did you mean {', '.join(near)}?")
    from_s = table.number("from_s", 0.0, 0.0, LONGEST_S)
    to_s = table.number("to_s", LONGEST_S, from_s, LONGEST_S)
    low, high = _limits(table)
    if low == -math.inf and high == math.inf:
        raise ScenarioError(f"{table.at('min')}: expected min, max or both")
    return SignalExpectation(name, from_s, to_s, low, high)

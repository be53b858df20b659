"""What a worker does: some runs in virtual time, from plain values to rows."""

import copy
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from hil.bench.result import MEASURED, Signals, measure
from hil.bench.run import EXPECTED, expected, missed
from hil.bench.virtual import simulate
from hil.errors import BrakebenchError, Verdict
from hil.log.write import write_log
from hil.scenario.scenario import Scenario, build_scenario, find_scenario
from hil.scenario.table import ScenarioError

REFUSED, KILLED = "refused", "killed"
"""Verdicts of a campaign beside those of a run: the scenario did not take the values; the run killed its worker."""
RECORDING_SUFFIX = ".log"
Row = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """One run: its number, the scenario, the seed of the noise, and (key, value) of what it varies."""

    number: int
    scenario: str
    seed: int
    changes: tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Base:
    """A scenario as it stands in its file.

    Attributes
    ----------
    source : path of the file; empty for a scenario of the library.
    sha256 : as of `Scenario`, CSV files included.
    """

    name: str
    source: str
    text: bytes
    values: dict[str, Any]
    sha256: str

    def scenario(self, changes: Mapping[str, Any]) -> Scenario:
        """The scenario with other values at some places.

        Raises
        ------
        hil.scenario.table.ScenarioError, hil.scenario.parameters.ParameterError : it does not take them.
        """
        values = copy.deepcopy(self.values)
        for key, value in changes.items():
            _put(values, key, copy.deepcopy(value), self.name)
        source: Path | Traversable = Path(self.source) if self.source else find_scenario(self.name)
        return build_scenario(values, source, self.text)


@dataclass(frozen=True)
class Done:
    """What came of a run: its row, and its recording where that is kept."""

    row: Row
    recording: bytes | None = None


@dataclass(frozen=True)
class Runner:
    """What a worker does with a run.

    Attributes
    ----------
    bases : scenarios by name.
    recordings : of which runs the recording is kept: ``failed``, ``all``, ``none``.
    """

    bases: Mapping[str, Base]
    recordings: str

    def __call__(self, run: Run) -> Done:
        """Run it; whatever a run raises is a result."""
        signals: Signals | None = None
        row: Row = {"run": run.number}
        try:
            scenario = self.bases[run.scenario].scenario(dict(run.changes))
        except BrakebenchError as error:
            return Done(row | {"verdict": REFUSED, "reason": str(error)})
        try:
            signals = simulate(scenario, run.seed)
            row |= _measured(scenario, signals)
        except Exception as error:
            row |= {"verdict": Verdict.BROKEN.value, "reason": f"{type(error).__name__}: {error}"}
        failed = row["verdict"] != Verdict.PASSED.value
        wanted = self.recordings == "all" or (self.recordings == "failed" and failed)
        return Done(row, _recording(signals) if wanted and signals is not None else None)


def killed(run: Run, times: int) -> Done:
    """What stands for a run that ended its worker each time."""
    return Done({"run": run.number, "verdict": KILLED, "reason": f"its worker process ended {times} times in this run"})


def _measured(scenario: Scenario, signals: Signals) -> Row:
    """Verdict and figures; a figure that a run has not is NaN."""
    result = measure(signals)
    numbers = {name: value for name, value in result.as_json().items() if name in MEASURED}
    row: Row = {name: math.nan if value is None else float(value) for name, value in numbers.items()}
    misses = []
    for number in expected(scenario, result, signals):
        row[f"met.{number.label.removeprefix(EXPECTED)}"] = bool(number.met)
        if not number.met:
            misses.append(missed(number))
    verdict = Verdict.FAILED if misses else Verdict.PASSED
    return row | {"verdict": verdict.value, "reason": "; ".join(misses)}


def _recording(signals: Signals) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"recording{RECORDING_SUFFIX}"
        write_log(signals.decoded.recording.frames, path)
        return path.read_bytes()


def _put(values: dict[str, Any], key: str, value: Any, where: str) -> None:
    """Put a value at a place: names of tables, and numbers of what stands in lists, with dots between."""
    at: Any = values
    *path, last = key.split(".")
    for name in path:
        at = at[_index(at, name, key, where)] if isinstance(at, list) else at.setdefault(name, {})
        if not isinstance(at, dict | list):
            raise ScenarioError(f"{where}: {key}: {name} is {at!r}, which holds nothing")
    at[_index(at, last, key, where) if isinstance(at, list) else last] = value


def _index(at: list[Any], name: str, key: str, where: str) -> int:
    if not name.isdecimal() or int(name) >= len(at):
        raise ScenarioError(f"{where}: {key}: expected a number from 0 to {len(at) - 1} in place of {name!r}")
    return int(name)

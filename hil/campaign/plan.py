"""What a campaign runs: CAMPAIGN.toml, checked, as numbered runs that no order of work changes."""

import copy
import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hil.bench.result import MEASURED
from hil.campaign.sample import METHODS, Varied, sampled
from hil.campaign.tasks import Base, Run, Runner
from hil.scenario.scenario import build_scenario, find_scenario, read_scenario_file
from hil.scenario.table import Files, ScenarioError, Table

MOST_RUNS = 100_000_000
RECORDINGS = ("failed", "all", "none")
_PARTS, _MOST_IN_PART = 256, 1024  # a part is what a worker takes at a time and one file holds


class CampaignError(ScenarioError):
    """A campaign that cannot be used as it is; the message names file and key."""


class _Place(NamedTuple):
    scenario: str
    point: int
    seed: int


@dataclass(frozen=True)
class Plan:
    """A campaign.

    Attributes
    ----------
    title, source : one line for people, and the file.
    bases : scenarios by name.
    varied : what is varied, in the order of the file.
    method, seed : how points are chosen, and the seed of a sample.
    seeds : seeds of the noise that every point is run with.
    recordings : of which runs the recording is kept.
    points : (points, varied) of each point its place in every list of values, or its number.
    expectations : what the scenarios expect, by name.
    """

    title: str
    source: Path
    bases: Mapping[str, Base]
    varied: tuple[Varied, ...]
    method: str
    seed: int
    seeds: tuple[int, ...]
    recordings: str
    points: np.ndarray
    expectations: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(self.bases) * len(self.points) * len(self.seeds)

    @property
    def part_size(self) -> int:
        """Runs of a part; by the size of the campaign alone, so that every file is the same whoever runs it."""
        return min(_MOST_IN_PART, max(1, self.size // _PARTS))

    @property
    def parts(self) -> int:
        """Number of parts."""
        return -(-self.size // self.part_size)

    @cached_property
    def fingerprint(self) -> str:
        """Hash of everything that decides the results but brakebench itself."""
        parts: list[Any] = [[name, base.sha256] for name, base in self.bases.items()]
        parts += [[one.key, one.name, one.values, one.labels] for one in self.varied]
        parts += [self.method, self.seed, self.seeds, hashlib.sha256(self.points.tobytes()).hexdigest()]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    def run(self, number: int) -> Run:
        """Run of a number: scenarios outermost, noise innermost."""
        scenario, point, seed = self._place(number)
        return Run(number, scenario, seed, tuple(zip((v.key for v in self.varied), self._values(point), strict=True)))

    def inputs(self, number: int) -> dict[str, float | str]:
        """What a run varies, by name: a number, or the label of a value that is none."""
        point = self._place(number).point
        row = zip(self.varied, self.points[point], strict=True)
        return {one.name: one.shown(float(place)) for one, place in row}

    def part(self, number: int) -> list[Run]:
        """Runs of a part."""
        first = number * self.part_size
        return [self.run(k) for k in range(first, min(self.size, first + self.part_size))]

    @property
    def runner(self) -> Runner:
        """What workers do with a run."""
        return Runner(self.bases, self.recordings)

    def _place(self, number: int) -> _Place:
        scenario, rest = divmod(number, len(self.points) * len(self.seeds))
        point, seed = divmod(rest, len(self.seeds))
        return _Place(tuple(self.bases)[scenario], point, self.seeds[seed])

    def _values(self, point: int) -> Iterator[Any]:
        for one, place in zip(self.varied, self.points[point], strict=True):
            yield one.value(float(place))


def load_plan(path: Path) -> Plan:
    """Read a campaign.

    Raises
    ------
    CampaignError, hil.scenario.table.ScenarioError, hil.scenario.parameters.ParameterError
        A wrong field of the campaign, or a value that a scenario refuses.
    """
    _, values = read_scenario_file(path)
    top = Table(values, path.name, Files(path.parent))
    title = top.text("title", path.stem)
    method = top.choice("method", METHODS) if top.has("method") else "grid"
    bases = {name: _base(name, path.parent) for name in _texts(top, "scenarios", ["stop72"])}
    varied = tuple(_varied(table, method) for table in top.tables("vary"))
    names = [one.name for one in varied]
    if len(set(names)) < len(names) or set(names) & {"run", "scenario", "seed", "verdict", "reason", *MEASURED}:
        raise CampaignError(f"{path.name}: vary: names must differ from each other and from results; give another name")
    seed = round(top.number("seed", 1, 0, 2**31 - 1))
    count = round(top.number("count", 0, 0, MOST_RUNS)) if top.has("count") else None
    seeds = round(top.number("seeds", 1, 1, MOST_RUNS))
    recordings = top.choice("recordings", RECORDINGS) if top.has("recordings") else "failed"
    top.done()
    points = sampled(varied, method, count, seed, path.name)
    if len(bases) * len(points) * seeds > MOST_RUNS:
        raise CampaignError(f"{path.name}: {len(bases)} scenarios x {len(points)} points x {seeds} seeds are more than "
                            f"{MOST_RUNS:,} runs; vary less")  # fmt: skip
    expectations = list(itertools.chain.from_iterable(_expected(base) for base in bases.values()))
    plan = Plan(
        title, path, bases, varied, method, seed, tuple(range(seed, seed + seeds)), recordings, points,
        tuple(dict.fromkeys(expectations)),
    )  # fmt: skip
    _check(plan)
    return plan


def _texts(top: Table, key: str, default: Sequence[str]) -> list[str]:
    value = top.take(key, list(default))
    if not isinstance(value, list) or not value or not all(isinstance(one, str) for one in value):
        raise CampaignError(f"{top.at(key)}: expected a list of scenarios, got {value!r}")
    return list(dict.fromkeys(value))


def _base(name: str, folder: Path) -> Base:
    source = find_scenario(name)
    if isinstance(source, Path) and not source.is_absolute() and not source.exists():
        source = folder / source
    text, values = read_scenario_file(source)
    loaded = build_scenario(values, source, text)
    return Base(name, str(source) if isinstance(source, Path) else "", text, values, loaded.sha256)


def _expected(base: Base) -> list[str]:
    loaded = base.scenario({})
    return [one.name for one in loaded.expectations] + [one.name for one in loaded.signal_expectations]


def _varied(table: Table, method: str) -> Varied:
    key = table.text("key")
    name = table.text("name", key)
    if table.has("values"):
        values = table.take("values")
        if not isinstance(values, list) or not values:
            raise CampaignError(f"{table.at('values')}: expected a list of values, got {values!r}")
        labels = table.take("labels", [one if isinstance(one, str) else json.dumps(one) for one in values])
        if not isinstance(labels, list) or len(labels) != len(values) or not all(isinstance(x, str) for x in labels):
            raise CampaignError(f"{table.at('labels')}: expected a text for each of the {len(values)} values")
        table.done()
        return Varied(key, name, values=tuple(copy.deepcopy(values)), labels=tuple(labels))
    low = table.number("low", None)
    high = table.number("high", None, low)
    steps = round(table.number("steps", None, 2, MOST_RUNS)) if method == "grid" else 0
    table.done()
    if steps:
        return Varied(key, name, values=tuple(np.linspace(low, high, steps).tolist()))
    return Varied(key, name, low, high)


def _check(plan: Plan) -> None:
    """Have every scenario read with every value once, or with both ends of a range: better now than in a worker."""
    for base in plan.bases.values():
        for one in plan.varied:
            for value in one.values or (one.low, one.high):
                base.scenario({one.key: value})

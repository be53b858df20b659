"""The model's own error: what candidates seem to explain on drives of the reference car with nothing hidden."""

import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.diagnosis.detection.group_score_test import GroupScoreTest
from hil.diagnosis.detection.nonparametric import BASIS_SIZE
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.detection.score_test import ScoreTest
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, UNMEASURED_RATIO
from hil.diagnosis.estimation.terms import location_kind
from hil.diagnosis.explain import explain
from hil.diagnosis.result.answer import Answer
from hil.validation.reference_car.cases import draw
from hil.validation.reference_car.files import write

_SELDOM_TOLD = (
    "suspension_", "vehicle_pitch_inertia_kg_m2", "vehicle_roll_inertia_kg_m2", "disc_", "node_latency_s",
    "line_lag_s",
)  # fmt: skip
"""What a stranger's set hardly ever tells."""
_PRIOR_CASES = 6
_LEAST_USUAL = 0.3
Key = tuple[str, str, str]
"""Effect, number and kind of place."""
Gains = dict[Key, list[float]]
Ratios = dict[str, dict[str, dict[str, float]]]
"""By effect, number and kind of place."""


def measure(count: int, seed: int, say: Callable[[str], None]) -> tuple[Gains, Gains]:
    """Gains of every number of an effect, and of every law in no list, by kind of place, over ``count`` null cases.

    Once with all that the car's set states, and once without its suspension, discs and latencies.

    All places count, not the better ones: the best of nine explains twice what one does by chance alone, and how many
    tests are made is the threshold's business (`hil.diagnosis.detection.threshold.chi2_quantile`). What may be
    on one side of nothing only counts where it is there: else half its tests would be zeros, and its error seem smaller
    than that of the same term by another name. They are made where the whole search ends, which may have restarted from
    numbers that explain more.
    """
    sprung: Gains = defaultdict(list)
    unsprung: Gains = defaultdict(list)
    for index in range(count):
        with TemporaryDirectory() as folder:
            logs = Path(folder) / "logs"
            write(draw("null", index, seed), logs)
            vehicle = tomllib.loads((logs / "vehicle.toml").read_text(encoding="utf-8"))
            without = {name: value for name, value in vehicle.items() if not name.startswith(_SELDOM_TOLD)}
            for found, stated in ((sprung, vehicle), (unsprung, without)):
                answer = explain(logs, stated)
                assert isinstance(answer, Answer)  # the reference car's logs tell forces
                for key, gain in (*_of_numbers(answer.diagnosis.scores), *_of_laws(answer.diagnosis)):
                    found[key].append(gain)
        say(f"null {index}")
    return sprung, unsprung


def _of_numbers(screened: Iterable[ScoreTest]) -> Iterator[tuple[Key, float]]:
    for item in screened:
        if item.typical_snr > _LEAST_USUAL and item.value != 0.0:
            candidate = item.candidate
            key = candidate.effect.name, candidate.parameter.name, location_kind(candidate.location)
            yield key, max(item.raw_gain - item.total_penalty, 0.0)


def _of_laws(found: Diagnosis) -> Iterator[tuple[Key, float]]:
    """Gains of the laws in no list, by coefficient."""
    model = found.base
    fitter = found.fitter.at_baseline(model)
    entries, _ = GroupScoreTest(fitter, fitter.parameter_set(model.z, ())).scores(fitter, model, found.first_noise)
    for entry in entries:
        yield (UNLISTED, entry.expansion.term.name, location_kind(entry.expansion.location)), entry.gain / BASIS_SIZE


def ratios(gains: Gains) -> Ratios:
    """Root mean square of estimate over standard deviation, by effect, number and kind of place.

    Few looks are drawn to the usual.
    """
    table: Ratios = {}
    for (effect, number, kind), values in sorted(gains.items()):
        mean = (sum(values) + _PRIOR_CASES * UNMEASURED_RATIO**2) / (len(values) + _PRIOR_CASES)
        table.setdefault(effect, {}).setdefault(number, {})[kind] = max(round(mean**0.5, 2), 1.0)
    return table


def tables(sprung: Gains, unsprung: Gains) -> dict[str, Ratios]:
    """Ratios of a car whose suspension is stated, and what of them is larger where it is not."""
    stated = ratios(sprung)
    larger: Ratios = {}
    for effect, numbers in ratios(unsprung).items():
        for name, kinds in numbers.items():
            known = stated.get(effect, {}).get(name, {})
            more = {kind: value for kind, value in kinds.items() if value > known.get(kind, UNMEASURED_RATIO)}
            if more:
                larger.setdefault(effect, {})[name] = more
    return {"ratio": stated, "unsprung": larger}


def as_toml(measured: Mapping[str, Ratios], count: int, seed: int) -> str:
    """The file's text."""
    lines = [f"# made by: brakebench trials --own-error FILE --count {count} --seed {seed}"]
    for table, effects in measured.items():
        for effect, numbers in effects.items():
            lines.append(f"[{table}.{effect}]")
            for name, kinds in numbers.items():
                lines.append(f"{_key(name)} = {{ {', '.join(f'{kind} = {value}' for kind, value in kinds.items())} }}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.isidentifier() else f'"{name}"'

"""The model's own error: what candidates seem to explain on drives of the hidden car with nothing hidden."""

from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hil.hide.cases import draw
from hil.hide.files import write
from hil.study.answer import Answer
from hil.study.basis import PIECES
from hil.study.diagnosis import Diagnosis, Settings
from hil.study.explain import explain
from hil.study.own_error import UNLISTED, USUAL
from hil.study.race import LawRace
from hil.study.screen import Score

_PRIOR_CASES = 6
_LEAST_USUAL = 0.3
Gains = dict[tuple[str, str], list[float]]


def measure(count: int, seed: int, say: Callable[[str], None]) -> Gains:
    """Gains of every number of an effect, and of every law in no list, over ``count`` null cases.

    Of each case the mean of its better places.
    """
    found: Gains = defaultdict(list)
    for index in range(count):
        with TemporaryDirectory() as folder:
            logs = Path(folder) / "logs"
            write(draw("null", index, seed), logs)
            answer = explain(logs, logs / "vehicle.toml", settings=Settings(most_causes=0))
        assert isinstance(answer, Answer)  # the hidden car's logs tell forces
        for number, gains in (_by_number(answer.found.screened) | _by_law(answer.found)).items():
            found[number].append(float(np.mean(sorted(gains)[-max(len(gains) // 2, 1) :])))
        say(f"null {index}")
    return found


def _by_number(screened: Iterable[Score]) -> Gains:
    gains: Gains = defaultdict(list)
    for item in screened:
        if item.usual > _LEAST_USUAL:
            gains[item.candidate.effect.name, item.candidate.parameter.name].append(item.raw)
    return gains


def _by_law(found: Diagnosis) -> Gains:
    """Gains of the laws in no list, by coefficient."""
    fitter, model = found.fitter, found.base
    gains: Gains = defaultdict(list)
    for entry in LawRace(fitter, fitter.world(model.z, ())).entries(fitter, model, found.noise):
        gains[UNLISTED, entry.curve.law.name].append(entry.gain / PIECES)
    return gains


def ratios(gains: Gains) -> dict[str, dict[str, float]]:
    """Root mean square of estimate over standard deviation by effect and number; few cases are drawn to the usual."""
    table: dict[str, dict[str, float]] = {}
    for (effect, number), values in sorted(gains.items()):
        mean = (sum(values) + _PRIOR_CASES * USUAL**2) / (len(values) + _PRIOR_CASES)
        table.setdefault(effect, {})[number] = max(round(mean**0.5, 2), 1.0)
    return table


def as_toml(table: dict[str, dict[str, float]], count: int, seed: int) -> str:
    """The file's text."""
    lines = [f"# made by: brakebench trials --own-error FILE --count {count} --seed {seed}", "[ratio]"]
    for effect, numbers in table.items():
        lines.append(f"{effect} = {{ {', '.join(f'{_key(name)} = {value}' for name, value in numbers.items())} }}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.isidentifier() else f'"{name}"'

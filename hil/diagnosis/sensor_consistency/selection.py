"""One number at a time: which of a model's numbers the data ask for, and which others would have done as well."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

from scipy.stats import t as student

from hil.diagnosis.compiled import WORKERS
from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.likelihood import Fit, Values, fit, standard_deviations, typical_noise
from hil.diagnosis.sensor_consistency.model import SensorModel

THRESHOLD = 20.0
"""Gain in -2 log likelihood asked of a number: noise gives it once in 100,000 looks, were the model true."""
_WORTH_A_FIT = 0.5
"""Share of that from which a number that was tried for a few rounds is fitted to the end: it may gain more then."""
ALPHA = 0.003
RARE = 0.01
"""How much less likely than another name, or number, one is that is not told beside it."""
_STARTS: Mapping[str, Sequence[float]] = {
    "gain": (0.0, -0.5, 0.5, -2.0), "filter_s": (0.02, 0.1, 0.5, 2.0),
    "yaw_gain": (0.0, -2.0), "ay_gain": (0.0, -2.0),
}  # fmt: skip
Progress = Callable[[str], None]


@dataclass(frozen=True)
class SelectionStep:
    """A number that was taken up, its gain, and what the others would have gained in its place (one fit each).

    ``instead`` are those that fit nearly as well: what was found with each, and how far behind in -2 log likelihood.
    """

    parameter: str
    gain: float
    others: Mapping[str, Fit]
    substitutes: Mapping[str, tuple["SelectionResult", float]] = field(default_factory=dict)


@dataclass(eq=False)
class SelectionResult:
    """What a model learnt.

    ``base`` has the numbers as handed in, ``final`` those taken up; ``deviation`` their standard deviations,
    ``tolerance`` what each may be off without being wrong, ``degrees`` the degrees of freedom of the intervals.
    """

    model: SensorModel
    given: Values
    base: Fit
    final: Fit
    block: Floats
    deviation: Values
    tolerance: Mapping[str, float]
    steps: list[SelectionStep] = field(default_factory=list)
    evidence: int = 0

    @property
    def degrees(self) -> int:
        """Manoeuvres less one; fewer where only some of them (``evidence``) say anything."""
        return max((self.evidence or int(self.block.max()) + 1) - 1, 1)

    @property
    def parameters(self) -> Values:
        """All numbers, as handed in and as learnt."""
        return {**self.given, **self.final.sensor}

    def interval(self, number: str) -> tuple[float, float]:
        """95 % of a number, Student's t over the manoeuvres."""
        half = float(student.ppf(0.975, self.degrees)) * self.deviation[number]
        value, of = self.final.sensor[number], self.model.parameters[number]
        return max(value - half, of.low), min(value + half, of.high)


def select_parameters(
    model: SensorModel, block: Floats, handed: Mapping[str, float], tolerance: Mapping[str, float], say: Progress,
    candidates: Sequence[str] | None = None, always: Sequence[str] = (), most: int = 6,
) -> SelectionResult:  # fmt: skip
    """Take up numbers one at a time, the one with the largest gain first; take out again what is not missed.

    Parameters
    ----------
    handed : numbers as handed in; the others are 0.  tolerance : see `SelectionResult`.
    always : numbers that nobody knows and that are no cause.
    """
    start = fit(model, {n: model.parameters[n].usual for n in always}, typical_noise(model), fixed=handed)
    found = SelectionResult(model, dict(handed), start, start, block, {}, tolerance)
    names = [n for n in (candidates or model.parameters) if n not in always]
    while len(found.steps) < most:
        left = [n for n in names if n not in found.final.sensor]
        with ThreadPoolExecutor(WORKERS) as pool:
            tried = dict(zip(left, pool.map(lambda n: _with(found, n), left), strict=True))
        taken = _take(found, tried)
        if taken is None:
            break
        step, found.final, found.deviation = taken
        found.steps.append(step)
        say(f"{step.parameter} = {found.final.sensor[step.parameter]:.4g}, gains {step.gain:.0f}")
    _prune(found)
    return found


def _with(found: SelectionResult, number: str) -> Fit:
    """The model with one more number free, from several starts: a few rounds, then more for those near the best."""
    noises = [found.final.noise]
    if not found.steps:  # what was taken for noise is none with the cause in place
        noises.append(typical_noise(found.model))
    firsts = []
    for start in _starts(found, number):
        sensor = {**found.final.sensor, number: start}
        firsts.append(min((_some_rounds(found, number, sensor, n, 3) for n in noises), key=lambda f: f.cost))
    firsts.sort(key=lambda f: f.cost)
    near = [f for k, f in enumerate(firsts) if k < 2 or f.cost < firsts[0].cost + THRESHOLD]
    return min((_some_rounds(found, number, f.sensor, f.noise, 12) for f in near), key=lambda f: f.cost)


def _starts(found: SelectionResult, number: str) -> list[float]:
    """Where a number begins: in the middle of every cell, of what cells resolve."""
    of, cell = found.model.parameters[number], 2.0 * found.model.resolution.get(number, 0.0)
    if cell:
        return [float(cell * (k + 0.5)) for k in range(math.ceil(of.low / cell), math.floor(of.high / cell))]
    return [found.given.get(number, 0.0) + start for start in _STARTS.get(number, (0.0,))]


def _some_rounds(found: SelectionResult, number: str, sensor: Values, noise: Values, rounds: int) -> Fit:
    """A fit that is not ended. What cells resolve stays where it is: far from an end, no search passes their edges."""
    if number not in found.model.resolution:
        return fit(found.model, sensor, noise, fixed=found.given, rounds=rounds)
    others = {n: v for n, v in sensor.items() if n != number}
    held = fit(found.model, others, noise, fixed={**found.given, number: sensor[number]}, rounds=rounds)
    return replace(held, sensor=held.sensor | {number: sensor[number]})


def _ended(found: SelectionResult, number: str, begun: Fit) -> Fit:
    """A fit to its end. What cells resolve is fitted from the next cells as well, and on while that is better."""
    best = fit(found.model, begun.sensor, begun.noise, fixed=found.given)
    of, cell = found.model.parameters[number], 2.0 * found.model.resolution.get(number, 0.0)
    for beside in (-cell, cell) if cell else ():
        at = cell * (math.floor(best.sensor[number] / cell) + 0.5) + beside
        while of.low < at < of.high:
            middle = _some_rounds(found, number, {**best.sensor, number: at}, best.noise, 12)
            there = fit(found.model, middle.sensor, middle.noise, fixed=found.given)
            if there.cost >= best.cost:
                break
            best, at = there, at + beside
    return best


def _take(found: SelectionResult, tried: Mapping[str, Fit]) -> tuple[SelectionStep, Fit, Values] | None:
    worth = [n for n in tried if found.final.cost - tried[n].cost >= _WORTH_A_FIT * THRESHOLD]
    most = min((tried[n].cost for n in worth), default=0.0)
    near = [n for n in worth if tried[n].cost < most + THRESHOLD]  # a few rounds more may change which is first
    with ThreadPoolExecutor(WORKERS) as pool:
        fitted = dict(zip(near, pool.map(lambda n: _ended(found, n, tried[n]), near), strict=True))
    for number in sorted(worth, key=lambda n: fitted[n].cost if n in fitted else tried[n].cost):
        better = fitted.get(number) or _ended(found, number, tried[number])
        if found.final.cost - better.cost < THRESHOLD:
            continue
        deviation = standard_deviations(found.model, better, found.block, found.given)
        if _beyond(found, better, deviation, number):
            others = {n: f for n, f in {**tried, **fitted}.items() if n != number}
            instead = _instead(found, others, better.cost)
            return SelectionStep(number, found.final.cost - better.cost, others, instead), better, deviation
    return None


def _instead(
    found: SelectionResult, others: Mapping[str, Fit], cost: float
) -> dict[str, tuple[SelectionResult, float]]:
    near = {}
    for number, fitted in others.items():
        if fitted.cost < min(cost - 2.0 * math.log(RARE), found.final.cost - THRESHOLD):
            deviation = standard_deviations(found.model, fitted, found.block, found.given)
            if _beyond(found, fitted, deviation, number):
                near[number] = replace(found, final=fitted, deviation=deviation), fitted.cost - cost
    return near


def _beyond(found: SelectionResult, fitted: Fit, deviation: Mapping[str, float], number: str) -> bool:
    """Whether a number is off by more than chance and tolerance: every manoeuvre is one piece of evidence."""
    off = abs(fitted.sensor[number] - found.given.get(number, 0.0))
    spread = (deviation[number] ** 2 + found.tolerance.get(number, 0.0) ** 2) ** 0.5
    return bool(off > float(student.ppf(1.0 - 0.5 * ALPHA, found.degrees)) * spread)


def _prune(found: SelectionResult) -> None:
    for step in list(found.steps):
        if len(found.steps) > 1 and not _beyond(found, found.final, found.deviation, step.parameter):
            rest = {n: v for n, v in found.final.sensor.items() if n != step.parameter}
            found.final = fit(found.model, rest, found.final.noise, fixed=found.given)
            found.deviation = standard_deviations(found.model, found.final, found.block, found.given)
            found.steps.remove(step)

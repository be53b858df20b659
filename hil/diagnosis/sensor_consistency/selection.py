"""Forward selection with backward elimination: the parameters that the data need, and which would fit as well."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scipy.stats import t as student

from hil.diagnosis.data.log import Floats
from hil.diagnosis.parallel import thread_map
from hil.diagnosis.sensor_consistency.likelihood import Fit, Values, fit, standard_deviations, typical_noise
from hil.diagnosis.sensor_consistency.model import SensorModel
from hil.diagnosis.sensor_consistency.threshold import ALPHA, CONVERGE_SHARE, RARE, THRESHOLD

_START_OFFSETS: Mapping[str, Sequence[float]] = {
    "gain": (0.0, -0.5, 0.5, -2.0), "filter_s": (0.02, 0.1, 0.5, 2.0),
    "yaw_gain": (0.0, -2.0), "ay_gain": (0.0, -2.0),
}  # fmt: skip
Progress = Callable[[str], None]


@dataclass(frozen=True)
class SelectionStep:
    """One accepted parameter.

    Attributes
    ----------
    gain : reduction of -2 log likelihood.
    others : parameter -> its fit in the place of this one.
    substitutes : those of them that fit nearly as well -> the result with it, and the difference in -2 log likelihood.
    """

    parameter: str
    gain: float
    others: Mapping[str, Fit]
    substitutes: Mapping[str, tuple["SelectionResult", float]] = field(default_factory=dict)


@dataclass(eq=False)
class SelectionResult:
    """The fitted model.

    Attributes
    ----------
    nominal : values that were given; all other parameters are nominally 0.
    base, final : fits before any parameter is accepted, and of the accepted ones.
    segment_id : (cells,) number of the segment.
    deviation : standard deviation of the fitted parameters.
    tolerance : standard deviation by which a parameter may be off without being wrong.
    informative_segments : how many segments bear on the parameters; 0 for all.
    """

    model: SensorModel
    nominal: Values
    base: Fit
    final: Fit
    segment_id: Floats
    deviation: Values
    tolerance: Mapping[str, float]
    steps: list[SelectionStep] = field(default_factory=list)
    informative_segments: int = 0

    @property
    def degrees_of_freedom(self) -> int:
        """Informative segments less one."""
        return max((self.informative_segments or int(self.segment_id.max()) + 1) - 1, 1)

    @property
    def parameters(self) -> Values:
        """All values, nominal or fitted."""
        return {**self.nominal, **self.final.parameters}

    def quantile(self, probability: float) -> float:
        """Quantile of Student's t over the informative segments."""
        return float(student.ppf(probability, self.degrees_of_freedom))

    def interval(self, name: str) -> tuple[float, float]:
        """95 % interval of a parameter within its bounds."""
        half = self.quantile(0.975) * self.deviation[name]
        value, bounds = self.final.parameters[name], self.model.parameters[name]
        return max(value - half, bounds.low), min(value + half, bounds.high)

    def is_significant(self, name: str, fitted: Fit, deviation: Mapping[str, float]) -> bool:
        """Whether a parameter differs from nominal by more than chance and tolerance; a segment is one observation."""
        difference = abs(fitted.parameters[name] - self.nominal.get(name, 0.0))
        spread = (deviation[name] ** 2 + self.tolerance.get(name, 0.0) ** 2) ** 0.5
        return bool(difference > self.quantile(1.0 - 0.5 * ALPHA) * spread)

    def refit(self, parameters: Mapping[str, float], noise: Mapping[str, float], iterations: int = 40) -> Fit:
        """Fit these parameters, the others nominal."""
        return fit(self.model, parameters, noise, fixed=self.nominal, iterations=iterations)

    def deviations_of(self, fitted: Fit) -> Values:
        """Standard deviations of a fit's parameters."""
        return standard_deviations(self.model, fitted, self.segment_id, self.nominal)


def select_parameters(
    model: SensorModel, segment_id: Floats, nominal: Mapping[str, float], tolerance: Mapping[str, float],
    progress: Progress, candidates: Sequence[str] | None = None, nuisances: Sequence[str] = (), max_steps: int = 6,
) -> SelectionResult:  # fmt: skip
    """Accept parameters one at a time, the one with the largest gain first; then eliminate those not needed.

    Parameters
    ----------
    nominal, tolerance : see `SelectionResult`.
    candidates : parameters that may be accepted; all of the model if None.
    nuisances : parameters that are always fitted and are no cause.
    """
    base = fit(model, {n: model.parameters[n].typical for n in nuisances}, typical_noise(model), fixed=nominal)
    result = SelectionResult(model, dict(nominal), base, base, segment_id, {}, tolerance)
    names = [n for n in (candidates or model.parameters) if n not in nuisances]
    while len(result.steps) < max_steps:
        remaining = [n for n in names if n not in result.final.parameters]
        tried = thread_map(lambda n: _multi_start(result, n), remaining)
        accepted = _accept(result, dict(zip(remaining, tried, strict=True)))
        if accepted is None:
            break
        step, result.final, result.deviation = accepted
        result.steps.append(step)
        progress(f"{step.parameter} = {result.final.parameters[step.parameter]:.4g}, gains {step.gain:.0f}")
    _eliminate_backward(result)
    return result


def _multi_start(result: SelectionResult, name: str) -> Fit:
    """Best fit with one more parameter: a few iterations from every start value, more for those near the best."""
    noises = [result.final.noise]
    if not result.steps:  # noise fitted without the cause contains the cause
        noises.append(typical_noise(result.model))
    short = []
    for start in _start_values(result, name):
        parameters = {**result.final.parameters, name: start}
        short.append(min((_iterate(result, name, parameters, noise, 3) for noise in noises), key=lambda f: f.cost))
    short.sort(key=lambda f: f.cost)
    near = [f for k, f in enumerate(short) if k < 2 or f.cost < short[0].cost + THRESHOLD]
    return min((_iterate(result, name, f.parameters, f.noise, 12) for f in near), key=lambda f: f.cost)


def _start_values(result: SelectionResult, name: str) -> list[float]:
    """Start values of a parameter; the middle of every cell if cells resolve it."""
    bounds, cell = result.model.parameters[name], 2.0 * result.model.resolution.get(name, 0.0)
    if cell:
        cells = range(math.ceil(bounds.low / cell), math.floor(bounds.high / cell))
        return [float(cell * (k + 0.5)) for k in cells]
    return [result.nominal.get(name, 0.0) + offset for offset in _START_OFFSETS.get(name, (0.0,))]


def _iterate(result: SelectionResult, name: str, parameters: Values, noise: Values, iterations: int) -> Fit:
    """A few iterations; a parameter that cells resolve stays: no gradient passes their edges far from the optimum."""
    if name not in result.model.resolution:
        return result.refit(parameters, noise, iterations)
    others = {n: v for n, v in parameters.items() if n != name}
    fixed = {**result.nominal, name: parameters[name]}
    fitted = fit(result.model, others, noise, fixed=fixed, iterations=iterations)
    return replace(fitted, parameters=fitted.parameters | {name: parameters[name]})


def _converge(result: SelectionResult, name: str, start: Fit) -> Fit:
    """Converged fit; for a parameter that cells resolve, also from the neighbouring cells while that is better."""
    best = result.refit(start.parameters, start.noise)
    bounds, cell = result.model.parameters[name], 2.0 * result.model.resolution.get(name, 0.0)
    for direction in (-cell, cell) if cell else ():
        at = cell * (math.floor(best.parameters[name] / cell) + 0.5) + direction
        while bounds.low < at < bounds.high:
            short = _iterate(result, name, {**best.parameters, name: at}, best.noise, 12)
            neighbour = result.refit(short.parameters, short.noise)
            if neighbour.cost >= best.cost:
                break
            best, at = neighbour, at + direction
    return best


def _accept(result: SelectionResult, tried: Mapping[str, Fit]) -> tuple[SelectionStep, Fit, Values] | None:
    """The significant parameter with the largest gain, its fit and standard deviations; None if none is above."""
    cost = result.final.cost
    promising = [n for n in tried if cost - tried[n].cost >= CONVERGE_SHARE * THRESHOLD]
    lowest = min((tried[n].cost for n in promising), default=0.0)
    near = [n for n in promising if tried[n].cost < lowest + THRESHOLD]  # their order may change on convergence
    converged = dict(zip(near, thread_map(lambda n: _converge(result, n, tried[n]), near), strict=True))
    for name in sorted(promising, key=lambda n: converged.get(n, tried[n]).cost):
        fitted = converged.get(name) or _converge(result, name, tried[name])
        if cost - fitted.cost < THRESHOLD:
            continue
        deviation = result.deviations_of(fitted)
        if result.is_significant(name, fitted, deviation):
            others = {n: f for n, f in {**tried, **converged}.items() if n != name}
            substitutes = _substitutes(result, others, fitted.cost)
            return SelectionStep(name, cost - fitted.cost, others, substitutes), fitted, deviation
    return None


def _substitutes(
    result: SelectionResult, others: Mapping[str, Fit], cost: float
) -> dict[str, tuple[SelectionResult, float]]:
    """Significant parameters that fit nearly as well as the accepted one, whose -2 log likelihood is ``cost``."""
    limit = min(cost - 2.0 * math.log(RARE), result.final.cost - THRESHOLD)
    substitutes = {}
    for name, fitted in others.items():
        if fitted.cost < limit:
            deviation = result.deviations_of(fitted)
            if result.is_significant(name, fitted, deviation):
                substitutes[name] = replace(result, final=fitted, deviation=deviation), fitted.cost - cost
    return substitutes


def _eliminate_backward(result: SelectionResult) -> None:
    """Remove accepted parameters that are not significant given the others; one always stays."""
    for step in list(result.steps):
        if len(result.steps) > 1 and not result.is_significant(step.parameter, result.final, result.deviation):
            rest = {n: v for n, v in result.final.parameters.items() if n != step.parameter}
            result.final = result.refit(rest, result.final.noise)
            result.deviation = result.deviations_of(result.final)
            result.steps.remove(step)

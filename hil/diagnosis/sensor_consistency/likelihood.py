"""Largest likelihood of sensor numbers and noise together, and what the data say of each number."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import minimize

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel

Values = dict[str, float]
_STEP = 1e-3
"""Of gradients, in steps of the numbers."""
_WIDE_STEP, _IN_A_CELL = 0.3, 0.02
"""Of curvatures: across the bends that samples make which begin to count less (4 standard deviations off); and of what
cells resolve, whose edges are steps."""
NOTHING: Mapping[str, float] = MappingProxyType({})
_WIDEST = 3.0
_NO_STEP = 2
"""Status of a search along which no step was good enough."""
_UNKNOWN = 1e-3
"""Information before any data on a number of which nothing is known, per step of it squared."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Numbers of largest likelihood; ``cost`` is minus twice its logarithm, priors of the noise included."""

    sensor: Values
    noise: Values
    cost: float


def typical_noise(model: SensorModel) -> Values:
    """Noise to begin with."""
    return {name: number.usual for name, number in model.noise.items()}


def fit(
    model: SensorModel, sensor: Mapping[str, float], noise: Mapping[str, float], *, fixed: Mapping[str, float] = NOTHING,
    weights: Floats | None = None, rounds: int = 40, only_sensor: bool = False,
) -> Fit:  # fmt: skip
    """Move the numbers ``sensor`` and all noise to the largest likelihood.

    Where a number that cells resolve stands at the edge of one, the likelihood has a step or a bend that no search
    along a gradient passes: the others go on without it.

    Parameters
    ----------
    fixed : numbers that stay.  weights : (cells,) what counts, for held-out manoeuvres.
    only_sensor : leave the noise as it is.
    """
    names = [*sensor, *([] if only_sensor else noise)]
    numbers = [model.parameters[n] if n in sensor else model.noise[n] for n in names]

    def split(z: Floats) -> tuple[Values, Values]:
        values = {n: _value(number, v) for n, number, v in zip(names, numbers, z, strict=True)}
        return {n: values[n] for n in sensor}, dict(noise) | {n: v for n, v in values.items() if n not in sensor}

    def cost(z: Floats) -> float:
        moved, noisy = split(z)
        _, score = model.score({**fixed, **moved}, noisy)
        total = float(score.sum() if weights is None else score @ weights)
        value = -2.0 * total + _prior(model, moved, noisy)
        return value if np.isfinite(value) else 1e12

    start = {**noise, **sensor}
    z0 = np.array([_scaled(number, start[n]) for n, number in zip(names, numbers, strict=True)])
    if not names:
        return Fit({}, dict(noise), cost(z0))
    bounds = [(_scaled(number, number.low), _scaled(number, number.high)) for number in numbers]
    options = {"maxiter": rounds, "eps": _STEP, "ftol": 1e-9, "maxls": 15}
    found = minimize(cost, z0, method="L-BFGS-B", bounds=bounds, options=options)
    edged = [n in model.resolution for n in names]
    if found.status == _NO_STEP and any(edged) and not all(edged):
        held = [(z, z) if e else b for e, z, b in zip(edged, found.x, bounds, strict=True)]
        found = minimize(cost, found.x, method="L-BFGS-B", bounds=held, options=options)
    moved, noisy = split(found.x)
    return Fit(moved, noisy, float(found.fun))


def _scaled(number: Parameter, value: float) -> float:
    return float(np.log(value)) / number.step if number.log else value / number.step


def _value(number: Parameter, z: float) -> float:
    return float(np.exp(z * number.step)) if number.log else float(z * number.step)


def _prior(model: SensorModel, sensor: Mapping[str, float], noise: Mapping[str, float]) -> float:
    """Weak knowledge of noise keeps what the data do not show where roads and cars have it."""
    of_noise = sum((float(np.log(noise[n] / number.usual)) / number.prior) ** 2 for n, number in model.noise.items())
    known = [(value, model.parameters[n]) for n, value in sensor.items() if model.parameters[n].prior > 0.0]
    return of_noise + sum(((value - number.usual) / number.prior) ** 2 for value, number in known)


def standard_deviations(model: SensorModel, found: Fit, block: Floats, fixed: Mapping[str, float] = NOTHING) -> Values:
    """Standard deviation of every sensor number: curvature, widened where manoeuvres disagree more than they should.

    The sandwich of White, Econometrica 50 (1982), with the scores of whole manoeuvres; noise moves along. Where the
    likelihood is flat, or the fit stopped on a slope, what is known before is what is left.
    """
    inside = [n for n, v in found.noise.items() if 1.05 * model.noise[n].low < v < 0.95 * model.noise[n].high]
    names = [*found.sensor, *inside]  # noise at its bound stays there
    numbers = [model.parameters[n] if n in found.sensor else model.noise[n] for n in names]
    z = np.array(
        [_scaled(number, {**found.sensor, **found.noise}[n]) for n, number in zip(names, numbers, strict=True)]
    )
    count = int(block.max()) + 1

    def by_block(at: Floats) -> Floats:
        values = {n: _value(number, v) for n, number, v in zip(names, numbers, at, strict=True)}
        noise, sensor = found.noise | {n: values[n] for n in inside}, {n: values[n] for n in found.sensor}
        _, score = model.score({**fixed, **sensor}, noise)
        return np.bincount(block, score, count)

    size, steps = len(z), np.array([_IN_A_CELL if n in model.resolution else _WIDE_STEP for n in names])
    each = np.diag(steps)
    up, down = [by_block(z + e) for e in each], [by_block(z - e) for e in each]
    middle = by_block(z)
    gradient = np.array([(u - d) / (2.0 * step) for u, d, step in zip(up, down, steps, strict=True)])
    hessian = np.zeros((size, size))
    for i in range(size):
        hessian[i, i] = -(up[i] - 2.0 * middle + down[i]).sum() / steps[i] ** 2
        for j in range(i):
            e, f = each[i] + each[j], each[i] - each[j]
            mixed = (by_block(z + e) - by_block(z + f) - by_block(z - f) + by_block(z - e)).sum()
            hessian[i, j] = hessian[j, i] = -mixed / (4.0 * steps[i] * steps[j])
    values, vectors = np.linalg.eigh(hessian)
    known = [(number.step / number.prior) ** 2 if number.prior > 0.0 else _UNKNOWN for number in numbers]
    inverse = np.linalg.inv((vectors * np.maximum(values, 0.0)) @ vectors.T + np.diag(known))
    curvature = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    centred = gradient - gradient.mean(axis=1, keepdims=True)
    robust = np.sqrt(np.maximum(np.diag(inverse @ (centred @ centred.T) @ inverse), 0.0))
    spread = np.clip(robust, curvature, _WIDEST * curvature) if count >= 4 else curvature
    sizes = {n: float(s * number.step) for n, number, s in zip(names, numbers, spread, strict=True)}
    return {n: float(np.hypot(sizes[n], model.resolution.get(n, 0.0))) for n in found.sensor}

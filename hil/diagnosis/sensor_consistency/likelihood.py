"""Maximum-likelihood fit of a sensor model and its noise, and the standard deviations of the estimates."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import minimize

from hil.diagnosis.data.log import Floats
from hil.diagnosis.sensor_consistency.model import Parameter, SensorModel

Values = dict[str, float]
NO_VALUES: Mapping[str, float] = MappingProxyType({})
_GRADIENT_STEP = 1e-3
"""Finite difference of gradients, in steps of the parameters."""
_CURVATURE_STEP, _CURVATURE_STEP_IN_CELL = 0.3, 0.02
"""Finite difference of curvatures, in steps: wide enough to average over the kinks that outliers make (4 standard
deviations off), and narrow for parameters that cells resolve, whose likelihood has edges."""
_MAX_WIDENING = 3.0
"""The largest ratio of sandwich and curvature estimate that an interval is widened by."""
_LINE_SEARCH_FAILED = 2
"""Status of L-BFGS-B where no step along the search direction is good enough."""
_FLAT_INFORMATION = 1e-3
"""Information before data on a parameter with a flat prior, per squared step."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Estimates of largest likelihood.

    Attributes
    ----------
    parameters, noise : name -> estimate.
    cost : minus twice the log-likelihood, priors included.
    """

    parameters: Values
    noise: Values
    cost: float


def typical_noise(model: SensorModel) -> Values:
    """Noise from which a fit starts."""
    return {name: parameter.typical for name, parameter in model.noise.items()}


def fit(
    model: SensorModel, parameters: Mapping[str, float], noise: Mapping[str, float], *,
    fixed: Mapping[str, float] = NO_VALUES, weights: Floats | None = None, iterations: int = 40,
    fix_noise: bool = False,
) -> Fit:  # fmt: skip
    """Maximise the likelihood over ``parameters`` and all noise, from these values (L-BFGS-B).

    A parameter that cells resolve can stop the search at the edge of a cell, where the likelihood has a step or a kink:
    the others then go on without it.

    Parameters
    ----------
    fixed : values of further parameters, not fitted.
    weights : (cells,) factors of the log-likelihood; 0 holds a cell out.
    fix_noise : fit the parameters alone.
    """
    names = [*parameters, *([] if fix_noise else noise)]
    priors = [model.parameters[n] if n in parameters else model.noise[n] for n in names]

    def split(z: Floats) -> tuple[Values, Values]:
        values = {n: _from_steps(prior, v) for n, prior, v in zip(names, priors, z, strict=True)}
        return {n: values[n] for n in parameters}, dict(noise) | {
            n: v for n, v in values.items() if n not in parameters
        }

    def cost(z: Floats) -> float:
        trial, trial_noise = split(z)
        by_cell = model.log_likelihood({**fixed, **trial}, trial_noise)
        total = float(by_cell.sum() if weights is None else by_cell @ weights)
        value = -2.0 * total + _prior_cost(model, trial, trial_noise)
        return value if np.isfinite(value) else 1e12

    start = {**noise, **parameters}
    z0 = np.array([_in_steps(prior, start[n]) for n, prior in zip(names, priors, strict=True)])
    if not names:
        return Fit({}, dict(noise), cost(z0))
    bounds = [(_in_steps(prior, prior.low), _in_steps(prior, prior.high)) for prior in priors]
    options = {"maxiter": iterations, "eps": _GRADIENT_STEP, "ftol": 1e-9, "maxls": 15}
    optimum = minimize(cost, z0, method="L-BFGS-B", bounds=bounds, options=options)
    in_cells = [n in model.resolution for n in names]
    if optimum.status == _LINE_SEARCH_FAILED and any(in_cells) and not all(in_cells):
        narrowed = [(z, z) if cell else b for cell, z, b in zip(in_cells, optimum.x, bounds, strict=True)]
        optimum = minimize(cost, optimum.x, method="L-BFGS-B", bounds=narrowed, options=options)
    return Fit(*split(optimum.x), float(optimum.fun))


def _in_steps(parameter: Parameter, value: float) -> float:
    return float(np.log(value)) / parameter.step if parameter.log else value / parameter.step


def _from_steps(parameter: Parameter, z: float) -> float:
    return float(np.exp(z * parameter.step)) if parameter.log else float(z * parameter.step)


def _prior_cost(model: SensorModel, parameters: Mapping[str, float], noise: Mapping[str, float]) -> float:
    """Minus twice the log prior: it holds noise that the data do not show where roads and cars have it."""
    of_noise = sum((float(np.log(noise[n] / p.typical)) / p.prior) ** 2 for n, p in model.noise.items())
    known = [(value, model.parameters[n]) for n, value in parameters.items() if model.parameters[n].prior > 0.0]
    return of_noise + sum(((value - p.typical) / p.prior) ** 2 for value, p in known)


def standard_deviations(
    model: SensorModel, fitted: Fit, segment_id: Floats, fixed: Mapping[str, float] = NO_VALUES
) -> Values:
    """Standard deviation of every fitted parameter: curvature, widened where segments disagree more than they should.

    Sandwich estimate (White, Econometrica 50 (1982)) with the gradients of whole segments; noise is fitted along.
    Where the likelihood is flat, or the fit stopped on a slope, the prior is what is left.

    Parameters
    ----------
    segment_id : (cells,) number of the segment of each cell.
    """
    inside = [n for n, v in fitted.noise.items() if 1.05 * model.noise[n].low < v < 0.95 * model.noise[n].high]
    names = [*fitted.parameters, *inside]  # noise at its bound stays there
    priors = [model.parameters[n] if n in fitted.parameters else model.noise[n] for n in names]
    estimates = {**fitted.parameters, **fitted.noise}
    z = np.array([_in_steps(prior, estimates[n]) for n, prior in zip(names, priors, strict=True)])
    segments = int(segment_id.max()) + 1

    def by_segment(at: Floats) -> Floats:
        values = {n: _from_steps(prior, v) for n, prior, v in zip(names, priors, at, strict=True)}
        noise, parameters = fitted.noise | {n: values[n] for n in inside}, {n: values[n] for n in fitted.parameters}
        return np.bincount(segment_id, model.log_likelihood({**fixed, **parameters}, noise), segments)

    size = len(z)
    steps = np.array([_CURVATURE_STEP_IN_CELL if n in model.resolution else _CURVATURE_STEP for n in names])
    shifts = np.diag(steps)
    up, down = [by_segment(z + e) for e in shifts], [by_segment(z - e) for e in shifts]
    middle = by_segment(z)
    gradient = np.array([(u - d) / (2.0 * step) for u, d, step in zip(up, down, steps, strict=True)])
    hessian = np.zeros((size, size))
    for i in range(size):
        hessian[i, i] = -(up[i] - 2.0 * middle + down[i]).sum() / steps[i] ** 2
        for j in range(i):
            e, f = shifts[i] + shifts[j], shifts[i] - shifts[j]
            mixed = (by_segment(z + e) - by_segment(z + f) - by_segment(z - f) + by_segment(z - e)).sum()
            hessian[i, j] = hessian[j, i] = -mixed / (4.0 * steps[i] * steps[j])
    values, vectors = np.linalg.eigh(hessian)
    information = [(p.step / p.prior) ** 2 if p.prior > 0.0 else _FLAT_INFORMATION for p in priors]
    inverse = np.linalg.inv((vectors * np.maximum(values, 0.0)) @ vectors.T + np.diag(information))
    curvature = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    centred = gradient - gradient.mean(axis=1, keepdims=True)
    sandwich = np.sqrt(np.maximum(np.diag(inverse @ (centred @ centred.T) @ inverse), 0.0))
    spread = np.clip(sandwich, curvature, _MAX_WIDENING * curvature) if segments >= 4 else curvature
    deviation = {n: float(s * prior.step) for n, prior, s in zip(names, priors, spread, strict=True)}
    return {n: float(np.hypot(deviation[n], model.resolution.get(n, 0.0))) for n in fitted.parameters}

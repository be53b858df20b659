"""The linearised problem: information matrices by segment, nuisances marginalised, bounded steps.

Takes whitened residuals r and a Jacobian J (samples, columns); gives the products [r J]' [r J] by segment and solves
(J' J + I) dz = J' r - z for nuisances in prior standard deviations and unbounded or bounded columns beside them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import HUBER
from hil.diagnosis.noise.model import LONGITUDINAL, Noise, SampleMasks, tracks_of, whiten
from hil.diagnosis.progress import Progress, counted
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator

Tracks = Mapping[str, Floats]
_CHUNK = 48
"""Columns whitened at a time, for the memory they take."""
_HELD = 1e15
"""Information added to a nuisance that does not move: far above that of any data."""
_DIVERGED = 1e12
"""Largest difference quotient, for simulations that diverge at a step."""
_ROUNDING = 1e-12
"""Share of a channel's largest value below which a difference is rounding."""
_RIDGE = 1e-9
"""Share of each diagonal element that is added to it, for columns that are alike to rounding."""
_ACTIVE_SET_ROUNDS = 20
"""Rounds of the active set at most."""


@dataclass(frozen=True, eq=False)
class InformationBlocks:
    """Information by segment: ``matrix`` (segments, m, m), products of the whitened [residual, nuisances, columns].

    ``nuisances`` is their number, ``samples`` the number of compared samples, ``likelihood`` the log-likelihood of the
    noise at the residual.
    """

    matrix: Floats
    nuisances: int
    samples: int
    likelihood: float

    def total(self, weights: Floats | None = None) -> Floats:
        """Sum over segments, weighted; (m, m)."""
        if weights is None:
            return np.asarray(self.matrix.sum(axis=0))
        return np.asarray(np.tensordot(weights, self.matrix, axes=1))

    def since(self, segment: int) -> Floats:
        """Sum over segments for columns that are zero before this one; nuisances act in all."""
        total, later, own = self.total(), self.matrix[segment:].sum(axis=0), 1 + self.nuisances
        total[own:], total[:, own:] = later[own:], later[:, own:]
        return total


def finite_difference_jacobian(
    simulator: Simulator,
    frame: SampleMasks,
    base: Stack,
    parameter_sets: Sequence[ParameterSet],
    steps: Sequence[float],
    among: tuple[Sequence[int], int] | None = None,
    progress: Progress | None = None,
) -> dict[str, Floats]:
    """Finite differences of simulated channels, by track (samples, parameter sets), each divided by its step.

    ``base`` are the channels at no step. With ``among``, places and a width, columns stand at these places of a wider
    Jacobian that is 0 elsewhere. So is the column of a simulation that is not finite: it says nothing. ``progress``
    hears how many columns are done.
    """
    radius = float(simulator.vehicle.parameters.wheel.rolling_radius_m)
    places, width = among or (range(len(parameter_sets)), len(parameter_sets))
    out = {name: np.zeros((len(frame.log_start), width), np.float32) for name in frame.names}
    simulated = simulator.run_all(parameter_sets)
    if progress is not None:
        simulated = counted(progress, "Jacobian", simulated, len(parameter_sets))
    for k, stack, step in zip(places, simulated, steps, strict=True):
        if not all(np.isfinite(values).all() for values in stack.values()):
            continue
        change = {group: (values - base[group]) / step for group, values in stack.items()}
        for name, values in tracks_of(change, frame, radius).items():
            out[name][:, k] = np.clip(values[:, 0], -_DIVERGED, _DIVERGED)
    return out


def silent_columns(jacobian: Mapping[str, Floats]) -> list[int]:
    """Columns of a Jacobian, tracks of (samples, columns), that are zero."""
    acting = [values.any(axis=0) for values in jacobian.values()]
    return np.flatnonzero(~np.any(acting, axis=0)).tolist() if acting else []


def acting_among(
    simulator: Simulator, base: Stack, stepped: Callable[[Sequence[int]], ParameterSet], places: Sequence[int]
) -> list[int]:
    """Those of the ``places`` whose parameters change the channels, ``base`` being those at no step.

    ``stepped`` gives the parameter set with several of them a step off. Where nothing changes none acts, so that one
    replay answers for all; else for each half (Dorfman 1943, Ann. Math. Stat. 14, 436).
    """
    if not places or _unchanged(simulator.run(stepped(places)), base):
        return []
    if len(places) == 1:
        return list(places)
    half = len(places) // 2
    return [k for part in (places[:half], places[half:]) for k in acting_among(simulator, base, stepped, part)]


def _unchanged(stack: Stack, base: Stack) -> bool:
    return all(
        bool((np.abs(values - base[group]) <= _ROUNDING * np.abs(base[group]).max(initial=0.0)).all())
        for group, values in stack.items()
    )


def information_blocks(
    residual: dict[str, Floats], columns: Tracks | Sequence[Tracks], frame: SampleMasks, noise: Noise, nuisances: int,
    precise: bool = False,
) -> InformationBlocks:  # fmt: skip
    """Whiten residual (samples, 1) and columns (samples, columns) by track, and sum their products by segment.

    Several Jacobians stand side by side. Only tracks with a common noise are whitened together, for the memory. With
    ``precise`` products are made in double precision: for combinations of columns that nearly cancel.
    """
    parts = (columns,) if isinstance(columns, Mapping) else columns
    white_residual, likelihood = whiten(residual, frame, noise)
    count = sum(next(iter(part.values())).shape[1] for part in parts)
    segments = np.asarray(frame.segment_id, np.int64)
    segment_count = int(segments.max()) + 1
    order = None if (np.diff(segments) >= 0).all() else np.argsort(segments, kind="stable")
    bounds = np.searchsorted(np.sort(segments), np.arange(segment_count + 1))

    matrix = np.zeros((segment_count, count + 1, count + 1))
    along = [name for name in residual if name in LONGITUDINAL]
    for names in (along, *([name] for name in residual if name not in LONGITUDINAL)):
        whitened = {name: np.empty((len(segments), count + 1), np.float32) for name in names}
        at = 1
        for part in parts:
            for begin in range(0, next(iter(part.values())).shape[1], _CHUNK):
                chunk = {name: part[name][:, begin : begin + _CHUNK] for name in names}
                for name, values in whiten(chunk, frame, noise)[0].items():
                    width = values.shape[1]
                    whitened[name][:, at : at + width] = values
                at += width
        for name, values in whitened.items():
            values[:, 0] = _limited(white_residual[name][:, 0])
            ordered = values if order is None else values[order]
            for k in range(segment_count):
                block = ordered[bounds[k] : bounds[k + 1]]
                block = block.astype(np.float64) if precise else block
                matrix[k] += block.T @ block
    samples = int(sum(float(known.sum()) for known in frame.present.values()))
    return InformationBlocks(matrix, nuisances, samples, likelihood)


def _limited(innovations: Floats) -> Floats:
    """Innovations within `HUBER` standard deviations: a single outlier is no evidence for a cause."""
    return np.clip(innovations, -HUBER, HUBER)


@dataclass(frozen=True, eq=False)
class Marginal:
    """Information of the columns, nuisances and accepted terms marginalised.

    ``b`` (columns,) is the score (products with the residual), ``q`` (columns, columns) the information matrix,
    ``chi2`` that of the residual.
    """

    b: Floats
    q: Floats
    chi2: float


def marginalise(
    total: Floats, nuisances: int, free: Sequence[int] = (), z: Floats | None = None, held: Sequence[int] = ()
) -> Marginal:
    """Project out nuisances (Gaussian prior of standard deviation 1, now at ``z``) and the columns ``free`` (no prior).

    ``total`` (m, m) are products of [residual, nuisances, columns]. Nuisances that are ``held`` do not move.
    """
    a, right = _normal_equations(total, nuisances, free, z, held)
    solved = np.linalg.solve(a, right) if len(a) else np.zeros((0, total.shape[1]))
    left = total - right.T @ solved
    keep = 1 + nuisances
    prior = float(z @ z) if z is not None else 0.0
    return Marginal(np.asarray(left[0, keep:]), np.asarray(left[keep:, keep:]), float(left[0, 0]) + prior)


def marginalise_from_onset(
    information: InformationBlocks,
    groups: Sequence[Sequence[int]],
    free: Sequence[int],
    z: Floats,
    held: Sequence[int],
) -> tuple[Floats, Floats]:
    """As `marginalise`, for signatures that are zero before an onset at the start of each segment.

    Parameters
    ----------
    groups : columns that are summed to one signature, for each signature.

    Returns
    -------
    Products with the residual, and with itself, (segments, signatures).
    """
    a, right = _normal_equations(information.total(), information.nuisances, free, z, held)
    at, keep = _unknowns(information.nuisances, free), 1 + information.nuisances
    later = np.cumsum(information.matrix[::-1], axis=0)[::-1]
    step = np.linalg.solve(a, right[:, 0])
    b, q = np.empty((2, len(later), len(groups)))
    for k, group in enumerate(groups):
        own = [keep + column for column in group]
        cross = later[:, at][:, :, own].sum(axis=2)
        cross[:, list(held)] = 0.0
        b[:, k] = later[:, 0, own].sum(axis=1) - cross @ step
        q[:, k] = later[:, own][:, :, own].sum(axis=(1, 2)) - np.sum(cross * np.linalg.solve(a, cross.T).T, axis=1)
    return b, q


def _unknowns(nuisances: int, free: Sequence[int]) -> list[int]:
    """Rows of the information matrix that are solved for: nuisances, then the columns ``free``."""
    return [1 + k for k in range(nuisances)] + [1 + nuisances + k for k in free]


def _normal_equations(
    total: Floats, nuisances: int, free: Sequence[int], z: Floats | None, held: Sequence[int] = ()
) -> tuple[Floats, Floats]:
    """Information of nuisances and ``free`` columns, priors included, and its right-hand sides.

    The right-hand sides are products with [residual, nuisances, columns], (unknowns, 1 + nuisances + columns); of the
    residual the pull of the priors at ``z`` is taken. Nuisances that are ``held`` do not move.
    """
    at = _unknowns(nuisances, free)
    a = total[np.ix_(at, at)].copy()
    right = total[at].copy()
    a[range(nuisances), range(nuisances)] += 1.0
    if z is not None:
        right[:nuisances, 0] -= z
    a[list(held), list(held)] += _HELD
    right[list(held)] = 0.0
    a[range(len(a)), range(len(a))] += _RIDGE * (1.0 + np.diag(a))
    return a, right


def solve(total: Floats, nuisances: int, free: Sequence[int], z: Floats) -> tuple[Floats, Floats]:
    """Steps of the nuisances and of the columns ``free``, (unknowns,), and the covariance of the latter."""
    a, right = _normal_equations(total, nuisances, free, z)
    inverse = np.linalg.inv(a)
    return np.asarray(inverse @ right[:, 0].copy()), np.asarray(inverse[nuisances:, nuisances:])


def solve_bounded(
    total: Floats, nuisances: int, free: Sequence[int], z: Floats, low: Floats, high: Floats, damping: float = 0.0
) -> tuple[Floats, Floats, float]:
    """As `solve`, with bounds ``low`` and ``high`` on the steps, and the decrease of the cost if the model is linear.

    ``damping`` adds a share of each unknown's own information (Marquardt 1963). An unknown that would pass its bound
    stays there while all others are solved for again (active set; Nocedal and Wright 2006, alg. 16.3).
    """
    a, sides = _normal_equations(total, nuisances, free, z)
    right = sides[:, 0].copy()
    damped = a.copy()
    damped[range(len(a)), range(len(a))] *= 1.0 + damping
    change, at_bound = np.zeros(len(a)), np.zeros(len(a), bool)
    for _ in range(_ACTIVE_SET_ROUNDS):
        inside = np.flatnonzero(~at_bound)
        rest = right[inside] - damped[np.ix_(inside, np.flatnonzero(at_bound))] @ change[at_bound]
        change[inside] = np.linalg.solve(damped[np.ix_(inside, inside)], rest)
        beyond = ~at_bound & ((change < low) | (change > high))
        pull = right - damped @ change
        released = at_bound & np.where(change <= low, pull > 0.0, pull < 0.0) & (low < high)
        if not beyond.any() and not released.any():
            break
        change = np.clip(change, low, high)
        at_bound = (at_bound & ~released) | beyond
    change = np.clip(change, low, high)
    reported = [k for k in range(len(a)) if k >= nuisances or not at_bound[k]]
    covariance = np.linalg.inv(a[np.ix_(reported, reported)])
    columns = len(a) - nuisances
    at = len(reported) - columns
    return change, covariance[at:, at:], float(2.0 * right @ change - change @ a @ change)

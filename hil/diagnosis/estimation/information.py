"""The linearised problem: whitened residual and sensitivities summed by manoeuvre, nuisances within tolerance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import HUBER
from hil.diagnosis.noise.model import Noise, SampleMasks, tracks_of, whiten
from hil.diagnosis.simulation.measurement_model import Stack
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.simulator import Simulator

_CHUNK = 48
_HELD = 1e15
_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class InformationBlocks:
    """Sums of products per manoeuvre: ``matrix`` (manoeuvres, m, m) of [residual, nuisances, columns]; how many
    samples, and the log-likelihood of the noise at the residual."""

    matrix: Floats
    nuisances: int
    samples: int
    likelihood: float

    def total(self, weights: Floats | None = None) -> Floats:
        """Sum over manoeuvres, weighted."""
        if weights is None:
            return np.asarray(self.matrix.sum(axis=0))
        return np.asarray(np.tensordot(weights, self.matrix, axes=1))

    def since(self, manoeuvre: int) -> Floats:
        """Sum over manoeuvres for columns that are nothing before this one; nuisances always are."""
        total, later, own = self.total(), self.matrix[manoeuvre:].sum(axis=0), 1 + self.nuisances
        total[own:], total[:, own:] = later[own:], later[:, own:]
        return total


def finite_difference_jacobian(
    rig: Simulator, frame: SampleMasks, base: Stack, worlds: Sequence[ParameterSet], steps: Sequence[float]
) -> dict[str, Floats]:
    """Finite differences of all worlds against ``base``, as tracks (samples, worlds)."""
    radius = float(rig.vehicle.parameters.wheel.rolling_radius_m)
    out = {name: np.zeros((len(frame.log_start), len(worlds)), np.float32) for name in frame.names}
    for k, (stack, step) in enumerate(zip(rig.run_all(worlds), steps, strict=True)):
        change = {group: (values - base[group]) / step for group, values in stack.items()}
        for name, values in tracks_of(change, frame, radius).items():
            out[name][:, k] = np.clip(values[:, 0], -1e12, 1e12)
    return out


def information_blocks(
    residual: dict[str, Floats], columns: dict[str, Floats], frame: SampleMasks, noise: Noise, nuisances: int
) -> InformationBlocks:
    """Whiten residual and columns, and sum their products by manoeuvre."""
    white_residual, likelihood = whiten(residual, frame, noise)
    count = next(iter(columns.values())).shape[1]
    blocks = np.asarray(frame.segment_id, np.int64)
    manoeuvres = int(blocks.max()) + 1
    order = np.argsort(blocks, kind="stable")
    bounds = np.searchsorted(blocks[order], np.arange(manoeuvres + 1))
    whitened = {name: np.empty((len(blocks), count + 1), np.float32) for name in residual}
    for name, values in white_residual.items():
        whitened[name][:, 0] = _limited(values[:, 0])
    for begin in range(0, count, _CHUNK):
        chunk = {name: values[:, begin : begin + _CHUNK] for name, values in columns.items()}
        for name, values in whiten(chunk, frame, noise)[0].items():
            whitened[name][:, 1 + begin : 1 + begin + values.shape[1]] = values
    matrix = np.zeros((manoeuvres, count + 1, count + 1))
    for values in whitened.values():
        ordered = values[order] if (np.diff(blocks) < 0).any() else values
        for k in range(manoeuvres):
            part = ordered[bounds[k] : bounds[k + 1]]
            matrix[k] += part.T @ part
    samples = int(sum(float(known.sum()) for known in frame.present.values()))
    return InformationBlocks(matrix, nuisances, samples, likelihood)


def _limited(innovations: Floats) -> Floats:
    """Innovations within six standard deviations: a single wild sample is no evidence for a cause."""
    return np.clip(innovations, -HUBER, HUBER)


@dataclass(frozen=True, eq=False)
class Marginal:
    """Residual and columns after the nuisances (and what is accepted) have taken their part.

    ``b`` (columns,) products with the residual, ``q`` (columns, columns) among themselves, ``chi2`` of the residual.
    """

    b: Floats
    q: Floats
    chi2: float


def marginalise(
    total: Floats, nuisances: int, free: Sequence[int] = (), z: Floats | None = None, held: Sequence[int] = ()
) -> Marginal:
    """Project out nuisances (normal, standard deviation 1, now ``z`` off) and the columns ``free`` (unbounded).

    Nuisances that are ``held`` take no part.
    """
    a, right = _nuisance_system(total, nuisances, free, z, held)
    solved = np.linalg.solve(a, right) if len(a) else np.zeros((0, total.shape[1]))
    left = total - right.T @ solved
    keep = 1 + nuisances
    prior = float(z @ z) if z is not None else 0.0
    return Marginal(np.asarray(left[0, keep:]), np.asarray(left[keep:, keep:]), float(left[0, 0]) + prior)


def marginalise_from_onset(
    found: InformationBlocks, columns: Sequence[Sequence[int]], free: Sequence[int], z: Floats, held: Sequence[int]
) -> tuple[Floats, Floats]:
    """As `marginalise`, for signatures that are nothing before the begin of each manoeuvre.

    Parameters
    ----------
    columns : which columns are one signature together, for each of them.

    Returns
    -------
    Products with the residual, and with itself, (manoeuvres, signatures).
    """
    a, right = _nuisance_system(found.total(), found.nuisances, free, z, held)
    taken, keep = _taken(found.nuisances, free), 1 + found.nuisances
    later = np.cumsum(found.matrix[::-1], axis=0)[::-1]
    along = np.linalg.solve(a, right[:, 0])
    b, q = np.empty((2, len(later), len(columns)))
    for k, own in enumerate(columns):
        at = [keep + column for column in own]
        cross = later[:, taken][:, :, at].sum(axis=2)
        cross[:, list(held)] = 0.0
        b[:, k] = later[:, 0, at].sum(axis=1) - cross @ along
        q[:, k] = later[:, at][:, :, at].sum(axis=(1, 2)) - np.sum(cross * np.linalg.solve(a, cross.T).T, axis=1)
    return b, q


def _taken(nuisances: int, free: Sequence[int]) -> list[int]:
    return [1 + k for k in range(nuisances)] + [1 + nuisances + k for k in free]


def _nuisance_system(
    total: Floats, nuisances: int, free: Sequence[int], z: Floats | None, held: Sequence[int]
) -> tuple[Floats, Floats]:
    """Information of what takes its part, what is known before included, and its products with all there is."""
    taken = _taken(nuisances, free)
    a = total[np.ix_(taken, taken)].copy()
    right = total[taken].copy()
    a[range(nuisances), range(nuisances)] += 1.0
    if z is not None:
        right[:nuisances, 0] -= z
    a[list(held), list(held)] += _HELD
    right[list(held)] = 0.0
    a[range(len(a)), range(len(a))] += 1e-9 * (1.0 + np.diag(a))
    return a, right


def solve(total: Floats, nuisances: int, free: Sequence[int], z: Floats) -> tuple[Floats, Floats]:
    """Steps of the nuisances and of the columns ``free``, and the covariance of the latter."""
    a, right = _normal_equations(total, nuisances, free, z)
    inverse = np.linalg.inv(a)
    return np.asarray(inverse @ right), np.asarray(inverse[nuisances:, nuisances:])


def solve_bounded(
    total: Floats, nuisances: int, free: Sequence[int], z: Floats, low: Floats, high: Floats, damping: float = 0.0
) -> tuple[Floats, Floats, float]:
    """As `solve`, no step below ``low`` or above ``high``, and what it takes off the cost if the model is linear.

    ``damping`` shortens the step in proportion to each number's own information (Marquardt 1963). What would go too far
    stays at its end while all others are solved for again (active set; Nocedal and Wright 2006, alg. 16.3).
    """
    a, right = _normal_equations(total, nuisances, free, z)
    damped = a.copy()
    damped[range(len(a)), range(len(a))] *= 1.0 + damping
    change, ended = np.zeros(len(a)), np.zeros(len(a), bool)
    for _ in range(_ROUNDS):
        inside = np.flatnonzero(~ended)
        rest = right[inside] - damped[np.ix_(inside, np.flatnonzero(ended))] @ change[ended]
        change[inside] = np.linalg.solve(damped[np.ix_(inside, inside)], rest)
        beyond = ~ended & ((change < low) | (change > high))
        pull = right - damped @ change
        back = ended & np.where(change <= low, pull > 0.0, pull < 0.0) & (low < high)
        if not beyond.any() and not back.any():
            break
        change = np.clip(change, low, high)
        ended = (ended & ~back) | beyond
    change = np.clip(change, low, high)
    open_ones = [k for k in range(len(a)) if k >= nuisances or not ended[k]]
    covariance = np.linalg.inv(a[np.ix_(open_ones, open_ones)])
    columns = len(a) - nuisances
    at = len(open_ones) - columns
    return change, covariance[at:, at:], float(2.0 * right @ change - change @ a @ change)


def _normal_equations(total: Floats, nuisances: int, free: Sequence[int], z: Floats) -> tuple[Floats, Floats]:
    """Normal equations: information with what is known before, and the pull."""
    taken = _taken(nuisances, free)
    a = total[np.ix_(taken, taken)].copy()
    right = total[taken, 0].copy()
    a[range(nuisances), range(nuisances)] += 1.0
    right[:nuisances] -= z
    a[range(len(a)), range(len(a))] += 1e-9 * (1.0 + np.diag(a))
    return a, right

"""Points of a campaign: every combination, or a seeded sample of a box."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from hil.scenario.table import ScenarioError

METHODS = ("grid", "list", "latin_hypercube", "sobol", "saltelli")
_FEWEST = 2  # points of a sample


@dataclass(frozen=True)
class Varied:
    """One thing that a campaign varies.

    Attributes
    ----------
    key : place in the scenario's file, with dots: ``plant.vehicle.mass_kg``, ``faults.0.at_s``, ``faults``.
    name : column of the results.
    low, high : ends of a range, in the unit of the scenario's file.
    values, labels : what it is chosen from instead, and how each is called.
    """

    key: str
    name: str
    low: float = 0.0
    high: float = 1.0
    values: tuple[Any, ...] = ()
    labels: tuple[str, ...] = ()

    def value(self, place: float) -> Any:
        """What stands in the scenario: ``place`` is a number of the range, or counts the values."""
        return self.values[int(place)] if self.values else place

    def shown(self, place: float) -> float | str:
        """What stands in the results."""
        value = self.value(place)
        return float(value) if self.is_number else self.labels[int(place)]

    @property
    def is_number(self) -> bool:
        """Whether every value is a number."""
        return all(isinstance(one, int | float) and not isinstance(one, bool) for one in self.values)


def sampled(varied: Sequence[Varied], method: str, count: int | None, seed: int, where: str) -> np.ndarray:
    """Points as (points, varied): numbers of a range, places in a list of values.

    ``grid`` combines every value with every other; ``list`` takes the first value of each, then the second.
    ``saltelli`` is the design of Saltelli 2010 (DOI 10.1016/j.cpc.2009.09.018) for Sobol' indices of first and total
    order: ``count`` base points, and ``count`` for each thing varied, twice.

    Parameters
    ----------
    count : points of a sample.  seed : of it.  where : file, for messages.

    Raises
    ------
    hil.scenario.table.ScenarioError : a count that the method does not take.
    """
    if method in ("grid", "list"):
        return _stated(varied, method, count, where)
    if count is None or count < _FEWEST:
        raise ScenarioError(f"{where}: count: expected the number of points, {_FEWEST} or more, for {method}")
    if not varied:
        raise ScenarioError(f"{where}: vary: a sample needs something to vary")
    if method != "latin_hypercube" and count & (count - 1):
        raise ScenarioError(f"{where}: count: {method} is balanced with powers of two alone; got {count}, "
                            f"take {1 << count.bit_length()}")  # fmt: skip
    return scaled(_unit(method, len(varied), count, seed), varied)


def _stated(varied: Sequence[Varied], method: str, count: int | None, where: str) -> np.ndarray:
    """Places of the values that are in the file."""
    if count is not None:
        raise ScenarioError(f"{where}: count: a {method} has as many points as its values give; leave it out")
    if any(not one.values for one in varied):
        raise ScenarioError(f"{where}: vary: a {method} needs values")
    if not varied:
        return np.zeros((1, 0))
    axes = [np.arange(len(one.values), dtype=np.float64) for one in varied]
    if method == "grid":
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))
    if len({len(axis) for axis in axes}) > 1:
        sizes = ", ".join(f"{one.name} {len(one.values)}" for one in varied)
        raise ScenarioError(f"{where}: vary: a list takes as many values of each, got {sizes}")
    return np.stack(axes, -1)


def _unit(method: str, d: int, count: int, seed: int) -> np.ndarray:
    """(points, d) in [0, 1)."""
    if method == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(d, rng=np.random.default_rng(seed)).random(count))
    if method == "sobol":
        return np.asarray(qmc.Sobol(d, rng=np.random.default_rng(seed)).random(count))
    both = np.asarray(qmc.Sobol(2 * d, rng=np.random.default_rng(seed)).random(count))
    a, b = both[:, :d], both[:, d:]
    # in the order that SALib's analysis reads: of each base point A, A with each column of B, B
    rows = np.repeat(a[:, None, :], d + 2, axis=1)
    for k in range(d):
        rows[:, 1 + k, k] = b[:, k]
    rows[:, d + 1] = b
    return rows.reshape(-1, d)


def scaled(unit: np.ndarray, varied: Sequence[Varied]) -> np.ndarray:
    """Points of the unit box on ranges and lists."""
    points = np.empty_like(unit)
    for k, one in enumerate(varied):
        if one.values:
            points[:, k] = np.minimum(np.floor(unit[:, k] * len(one.values)), len(one.values) - 1)
        else:
            points[:, k] = one.low + (one.high - one.low) * unit[:, k]
    return points


def sensitivities(varied: Sequence[Varied], figure: np.ndarray, seed: int) -> dict[str, np.ndarray]:
    """Sobol' indices of a figure over a ``saltelli`` design, by SALib: S1, ST and their 95 % half-widths.

    Parameters
    ----------
    figure : (points,) of all points of the design, in their order.

    Returns
    -------
    S1, S1_conf, ST, ST_conf : (varied,) each.
    """
    from SALib.analyze import sobol

    problem = {"num_vars": len(varied), "names": [one.name for one in varied], "bounds": [[0.0, 1.0]] * len(varied)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of figures that do not vary: their indices are NaN
        found = sobol.analyze(problem, figure, calc_second_order=False, seed=seed)
    return {name: np.asarray(found[name], np.float64) for name in ("S1", "S1_conf", "ST", "ST_conf")}

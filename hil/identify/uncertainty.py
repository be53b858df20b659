"""How well a fit tells the five parameters: intervals, correlations, and the joint region that holds the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from hil.identify.fit import MODEL_COORDINATES, Fit
from hil.identify.model import Pad

Floats = NDArray[np.float64]

WELL, POOR = 0.1, 0.25
"""Half of the 95 % interval over the value: up to which a number is well, above which it is poorly determined."""
STRONG_CORRELATION = 0.9
"""Two parameters with a larger correlation cannot be told apart by the record."""

_NORMAL_95 = 1.959964
_WIDEST = 40.0  # of a logarithm: nothing is known, and the number stays finite

_PARAMETERS = (
    ("a", "1/(K s)", "friction gained by heat"),
    ("b", "1/J", "friction lost by power"),
    ("c", "1/s", "rate of the temperature"),
    ("gamma", "K/W", "temperature rise by power"),
    ("eps", "W", "loss without power"),
)
_SHOWN_DIRECTLY = (
    ((0,), "mu at rest", "", "at mean power and temperature"),
    ((1,), "settling rate", "1/s", "b (Nv + eps) at mean power"),
    ((3, 4), "heating rate", "K/s", "c gamma Nv at mean power"),
)
"""Sums of coordinates; the last two are the rate and the rise of the temperature."""


@dataclass(frozen=True)
class Estimate:
    """One number with its 95 % interval."""

    symbol: str
    unit: str
    meaning: str
    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half of the interval, in the unit."""
        return 0.5 * (self.high - self.low)

    @property
    def told(self) -> str:
        """How well the record tells it: well, roughly or poorly."""
        share = self.half_width / self.value
        return "well" if share <= WELL else "poorly" if share > POOR else "roughly"


def log_covariance(fit: Fit) -> Floats:
    """Covariance of ln a, ln b, ln c, ln gamma, ln eps; (5, 5)."""
    share = fit.pad.eps / (fit.scale.power_w + fit.pad.eps)  # of epsilon in the sum beside which b stands
    turn = np.zeros((MODEL_COORDINATES, MODEL_COORDINATES))
    turn[0, [0, 1]] = 1.0, 1.0
    turn[1, [1, 2]] = 1.0, -share
    turn[2, 3] = turn[3, 4] = turn[4, 2] = 1.0
    return np.asarray(turn @ _model_covariance(fit) @ turn.T)


def estimates(fit: Fit) -> tuple[Estimate, ...]:
    """Return a, b, c, gamma and epsilon, each with its 95 % interval."""
    spread = np.sqrt(np.diag(log_covariance(fit)))
    return tuple(
        _estimate(symbol, unit, meaning, value, float(sd))
        for (symbol, unit, meaning), value, sd in zip(_PARAMETERS, fit.pad, spread, strict=True)
    )


def shown_directly(fit: Fit) -> tuple[Estimate, ...]:
    """Return the combinations that the record shows at once; usually known far better than a, b and epsilon."""
    found = []
    for places, symbol, unit, meaning in _SHOWN_DIRECTLY:
        value = np.exp(fit.coordinates[list(places)].sum())
        spread = np.sqrt(fit.covariance[np.ix_(places, places)].sum())
        found.append(_estimate(symbol, unit, meaning, float(value), float(spread)))
    return tuple(found)


def correlations(fit: Fit) -> Floats:
    """Return the correlations of ln a, ln b, ln c, ln gamma, ln eps; (5, 5)."""
    covariance = log_covariance(fit)
    spread = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(spread, spread))


def findings(fit: Fit) -> tuple[str, ...]:
    """Say in words what the record does not tell."""
    numbers, correlation = estimates(fit), correlations(fit)
    said = [
        f"{n.symbol} is poorly determined: 95 % interval {n.low:.3g} to {n.high:.3g} {n.unit}"
        for n in numbers
        if n.told == "poorly"
    ]
    said += [
        f"{numbers[i].symbol} and {numbers[j].symbol} are hardly told apart: correlation {correlation[i, j]:+.3f}"
        for i in range(len(numbers))
        for j in range(i)
        if abs(correlation[i, j]) > STRONG_CORRELATION
    ]
    said += [f"{name} ended at the edge of its box: its interval means nothing" for name in fit.at_edge]
    return tuple(said)


def disagreements(fit: Fit, repeat: Fit) -> tuple[str, ...]:
    """Say which parameters two records of one brake give further apart than both intervals allow."""
    spread = np.sqrt(np.diag(log_covariance(fit)) + np.diag(log_covariance(repeat)))
    apart = np.abs(np.log(fit.pad) - np.log(repeat.pad)) > _NORMAL_95 * spread
    pairs = zip(_PARAMETERS, fit.pad, repeat.pad, apart, strict=True)
    return tuple(
        f"{symbol} is {one:.3g} {unit} from the first record but {two:.3g} from the second, further apart than their "
        "intervals allow"
        for (symbol, unit, _), one, two, far in pairs
        if far
    )


def joint_statistic(fit: Fit, truth: Pad) -> float:
    """Distance of ``truth`` from the fit in units of the joint uncertainty: d' C^-1 d, start values left free.

    It is measured in the fit's own coordinates, where the region is closest to an ellipsoid.
    """
    distance = fit.scale.coordinates(truth, fit.start)[:MODEL_COORDINATES] - fit.coordinates[:MODEL_COORDINATES]
    return float(distance @ np.linalg.solve(_model_covariance(fit), distance))


def joint_limit(fit: Fit, level: float = 0.99) -> float:
    """Largest `joint_statistic` inside the joint region of ``level``: 5 F(5, nu), nu from the independent samples."""
    samples = fit.course.mu.size
    freedom = fit.torque_noise.independent(samples) + fit.temperature_noise.independent(samples) - fit.coordinates.size
    return float(MODEL_COORDINATES * fisher.ppf(level, MODEL_COORDINATES, max(freedom, 2.0)))


def _model_covariance(fit: Fit) -> Floats:
    return fit.covariance[:MODEL_COORDINATES, :MODEL_COORDINATES]


def _estimate(symbol: str, unit: str, meaning: str, value: float, spread: float) -> Estimate:
    reach = np.exp(min(_NORMAL_95 * spread, _WIDEST))
    return Estimate(symbol, unit, meaning, value, float(value / reach), float(value * reach))

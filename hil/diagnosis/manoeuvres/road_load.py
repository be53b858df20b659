"""Road load from coast-downs: the likelihood of speeds by an extended Kalman filter, its maximum and intervals.

Equation of motion, per effective mass, of a run in direction d = +-1 along the road (SAE J1263, ISO 10521-1):

    v' = -(a + d g s + b (v + d w)^2) + u

a and b are f0 and f2 over the effective mass, s the slope, w the wind against direction +1. As White and Korst (SAE
720099, 1972) do, the speed is fitted and not its derivative. u is a slow disturbance (gusts, road, tyres that warm up):
first order, as are its bounds; measured speeds have white noise beside it. Runs in both directions tell slope and wind
from a and b; else their priors do: slope within 0.5 % and wind within 16 km/h (limits of SAE J1263), as two standard
deviations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.stats import t as student_t

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats
from hil.diagnosis.manoeuvres.coasting import CELL_S, GRAVITY_MPS2, RoadLoad, Run

A, B, SLOPE, WIND, WHITE, SLOW, TIME = range(7)
"""Unknowns: a, b, slope (m/s2), wind; logarithms of white noise, of the disturbance and of its time constant."""
_SLOPE_SD, _WIND_SD = 0.5 * 0.005 * GRAVITY_MPS2, 0.5 * 16.0 / 3.6
_NOISE: Final = {WHITE: (0.02, 1.5), SLOW: (0.01, 1.2), TIME: (6.0, 0.9)}
"""Median and standard deviation of the logarithm, before data: m/s of a cell's mean, m/s2, s. Gusts last 3 to 20 s."""
_STEP: Final = np.array([5e-3, 1e-5, 5e-3, 0.2, 0.2, 0.2, 0.2])
"""Units in which the unknowns are searched."""
_LEAST_FREEDOM = 4.0
_FITTED = 4  # unknowns of the mean


@dataclass(frozen=True, eq=False)
class Fit:
    """Most likely unknowns, (7,), their covariance, (7, 7), and the degrees of freedom of the disturbance."""

    x: Floats
    covariance: Floats
    freedom: float

    @property
    def quantile(self) -> float:
        """How many standard deviations a 95 % interval reaches either way (Student's t)."""
        return float(student_t.ppf(0.975, self.freedom))


@compiled
def _likelihood(speed: Floats, direction: float, x: Floats, step: float) -> float:
    """-2 log likelihood of one run, (cells,): extended Kalman filter of speed and disturbance."""
    a, b, slope, wind = x[0], x[1], direction * x[2], direction * x[3]
    white, slow, time_s = np.exp(2.0 * x[4]), np.exp(2.0 * x[5]), np.exp(x[6])
    phi = np.exp(-step / time_s)
    q_uu = slow * (1.0 - phi * phi)
    q_vu = slow * time_s * (1.0 - phi) ** 2
    q_vv = slow * time_s * time_s * (2.0 * step / time_s - 3.0 + 4.0 * phi - phi * phi)
    v, u, p_vv, p_vu, p_uu = speed[0], 0.0, 1e4, 0.0, slow
    total, seen = 0.0, False
    for k in range(speed.size):
        if k > 0:
            first = -(a + slope + b * (v + wind) * abs(v + wind))
            middle = v + 0.5 * step * (first + u)
            second = -(a + slope + b * (middle + wind) * abs(middle + wind))
            f_v = np.exp(-2.0 * b * abs(middle + wind) * step)
            f_u = time_s * (1.0 - phi) * np.exp(-b * abs(middle + wind) * step)
            v, u = v + step * second + f_u * u, phi * u
            p_vv = f_v * f_v * p_vv + 2.0 * f_v * f_u * p_vu + f_u * f_u * p_uu + q_vv
            p_vu = phi * (f_v * p_vu + f_u * p_uu) + q_vu
            p_uu = phi * phi * p_uu + q_uu
        if np.isfinite(speed[k]):
            size, error = p_vv + white, speed[k] - v
            if seen:
                total += np.log(size) + error * error / size
            seen = True
            gain_v, gain_u = p_vv / size, p_vu / size
            v, u = v + gain_v * error, u + gain_u * error
            p_uu -= gain_u * p_vu
            p_vu *= 1.0 - gain_v
            p_vv *= 1.0 - gain_v
    return total


@compiled
def _coast(first_mps: float, direction: float, x: Floats, step: float, out: Floats) -> None:
    """Speeds of a run without disturbance, (cells,), from its first on."""
    v, slope, wind = first_mps, direction * x[2], direction * x[3]
    for k in range(out.size):
        out[k] = v
        middle = v - 0.5 * step * (x[0] + slope + x[1] * (v + wind) * abs(v + wind))
        v -= step * (x[0] + slope + x[1] * (middle + wind) * abs(middle + wind))


def simulated(run: Run, x: Floats) -> Floats:
    """Speed of a run without disturbance, (cells,), from the measured speed of its first two seconds on."""
    out, begin = np.empty(len(run.speed_mps)), max(round(2.0 / CELL_S), 1)
    first = float(run.speed_mps[np.isfinite(run.speed_mps)][0])
    for _ in range(2):
        _coast(first, float(run.direction), x, CELL_S, out)
        first += float(np.nanmean(run.speed_mps[:begin] - out[:begin]))
    _coast(first, float(run.direction), x, CELL_S, out)
    return out


def cost(runs: Sequence[Run], x: Floats) -> float:
    """-2 log posterior of unknowns ``x`` (7,), but for a constant."""
    prior = (x[SLOPE] / _SLOPE_SD) ** 2 + (x[WIND] / _WIND_SD) ** 2
    prior += sum(((x[at] - np.log(median)) / sd) ** 2 for at, (median, sd) in _NOISE.items())
    return float(prior + sum(_likelihood(run.speed_mps, float(run.direction), x, CELL_S) for run in runs))


def fit(runs: Sequence[Run], stated: RoadLoad, fixed: bool = False) -> Fit:
    """Fit all runs; ``fixed`` keeps a and b as stated, the rest is fitted."""
    start = np.array([stated.a_mps2, stated.b_1_m, 0.0, 0.0, *(np.log(median) for median, _ in _NOISE.values())])
    free = np.array([at for at in range(7) if not (fixed and at in (A, B))])

    def expanded(z: Floats) -> Floats:
        x = start.copy()
        x[free] += z * _STEP[free]
        return x

    def of(z: Floats) -> float:
        x = expanded(z)
        if abs(x[WHITE] - start[WHITE]) > 9.0 or abs(x[SLOW] - start[SLOW]) > 9.0 or abs(x[TIME] - start[TIME]) > 5.0:
            return 1e12
        value = cost(runs, x)
        return value if np.isfinite(value) else 1e12

    z = np.zeros(len(free))
    for _ in range(3):  # a second start with a fresh Hessian
        found = minimize(of, z, method="BFGS", options={"gtol": 1e-3, "maxiter": 200})
        moved = float(np.abs(found.x - z).max())
        z = np.asarray(found.x)
        if moved < 1e-2:
            break
    hessian = _hessian(of, z)
    values, vectors = np.linalg.eigh(hessian)
    inverse = (vectors / np.maximum(values, 1e-6)) @ vectors.T
    covariance = np.zeros((7, 7))
    covariance[np.ix_(free, free)] = 2.0 * inverse * np.outer(_STEP[free], _STEP[free])
    x = expanded(z)
    seconds = sum(float(np.isfinite(run.speed_mps).sum()) * CELL_S for run in runs)
    freedom = max(seconds / (2.0 * float(np.exp(x[TIME]))) - _FITTED, _LEAST_FREEDOM)
    return Fit(x, covariance, freedom)


def _hessian(of: Callable[[Floats], float], z: Floats, step: float = 0.1) -> Floats:
    """Second derivatives by central differences."""
    count, centre = len(z), of(z)
    hessian, one = np.zeros((count, count)), step * np.eye(count)
    for i in range(count):
        hessian[i, i] = (of(z + one[i]) - 2.0 * centre + of(z - one[i])) / step**2
        for j in range(i):
            alike = of(z + one[i] + one[j]) + of(z - one[i] - one[j])
            mixed = alike - of(z + one[i] - one[j]) - of(z - one[i] + one[j])
            hessian[i, j] = hessian[j, i] = mixed / (4.0 * step**2)
    return hessian


def with_stated(fitted: Fit, stated: RoadLoad) -> Floats:
    """Unknowns with the stated road load, on a flat road without wind."""
    x = fitted.x.copy()
    x[[A, B, SLOPE, WIND]] = stated.a_mps2, stated.b_1_m, 0.0, 0.0
    return x

"""Fit of a, b, c, gamma and epsilon of equations (3) and (4) to torque and temperature of one record.

Bounded Gauss-Newton with a trust region (scipy `least_squares`), from several starts. The coordinates are logarithms
of what the record shows directly, so that they are of one size and hardly correlated: the friction at rest and the
settling rate at the mean power, epsilon, the rate and the rise of the temperature, and the two start values.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from hil.errors import BrakebenchError
from hil.identify.model import Brake, Course, Drive, Heating, Pad, Start, drive, predict
from hil.identify.noise import Noise, coloured, measure_noise
from hil.identify.record import Record

Floats = NDArray[np.float64]

STARTS = 8
_SEED = 1
_FIRST_EVALUATIONS = 12  # of every start; the best are then run to the end
_KEPT = 3
_SAME = 1e-3  # relative difference of two costs that are the same valley
_STEP = 1e-5  # of a logarithm, for central differences
_ROUNDS = 6
_FINEST = 0.01  # N m and K: no sensor is weighed as better than that
_NAMES = ("mu at rest", "settling rate", "eps", "c", "temperature rise", "mu at the start", "temperature at the start")
MODEL_COORDINATES = 5
"""The first coordinates are the model's; the two start values follow."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What one heating form makes of a record.

    Attributes
    ----------
    coordinates : (7,) logarithms, see `Scale`.  covariance : (7, 7) of them, colour of the noise included.
    log_likelihood : of torque and temperature with white noise of the residuals' size; comparable between forms.
    valleys : how many of the three best starts ended in the same minimum.
    at_edge : coordinates that ended at the edge of their box.
    """

    heating: Heating
    pad: Pad
    start: Start
    course: Course
    torque_noise: Noise
    temperature_noise: Noise
    scale: "Scale"
    coordinates: Floats
    covariance: Floats
    log_likelihood: float
    valleys: int
    at_edge: tuple[str, ...]


@dataclass(frozen=True)
class Scale:
    """Mean power N v, W, and mean temperature, K, at which friction and its rate are the coordinates."""

    power_w: float
    temperature_k: float

    def coordinates(self, pad: Pad, start: Start) -> Floats:
        """Logarithms of mu at rest, settling rate 1/s, epsilon W, c 1/s, temperature rise K, mu and T at the start."""
        total = self.power_w + pad.eps
        at_rest = pad.a / pad.b * self.temperature_k / total
        return np.log([at_rest, pad.b * total, pad.eps, pad.c, pad.gamma * self.power_w, *start])

    def pad(self, coordinates: Floats) -> Pad:
        """Parameters of the equations."""
        at_rest, rate, eps, c, rise = np.exp(coordinates[:MODEL_COORDINATES]).tolist()
        b = rate / (self.power_w + eps)
        return Pad(at_rest * rate / self.temperature_k, b, c, rise / self.power_w, eps)


def fit(record: Record, brake: Brake, heating: Heating) -> Fit:
    """Fit one heating form of the model to a record.

    Raises
    ------
    BrakebenchError
        The brake never touches in the record.
    """
    driven = drive(record, brake)
    if not np.any(driven.power_w > 0.0):
        raise BrakebenchError(
            f"{record.name}: the pressure never passes the threshold of {brake.threshold_pressure_pa / 1e5:g} bar; "
            "record a brake that touches"
        )
    scale = Scale(float(driven.power_w.mean()), float(record.temperature_k.mean()))
    weights = np.maximum([record.torque_nm.std(), record.temperature_k.std()], _FINEST)
    lower, upper = _bounds(scale, driven)
    best, valleys = _from_starts(record, driven, scale, heating, weights, lower, upper)
    for _ in range(_ROUNDS):
        course, sizes = _residual_sizes(record, driven, scale, heating, best.x)
        if np.all(np.abs(np.log(sizes / weights)) < 0.01):
            break
        weights = sizes
        best = _descend(record, driven, scale, heating, weights, best.x, lower, upper)
    course, sizes = _residual_sizes(record, driven, scale, heating, best.x)
    torque_noise = measure_noise(record.torque_nm - course.torque_nm, record.torque_nm)
    temperature_noise = measure_noise(record.temperature_k - course.temperature_k, record.temperature_k)
    sensitivity = _sensitivity(driven, scale, heating, best.x, sizes)
    return Fit(
        heating,
        scale.pad(best.x),
        _start(best.x),
        course,
        torque_noise,
        temperature_noise,
        scale,
        best.x,
        _covariance(sensitivity, (torque_noise, temperature_noise)),
        -record.time_s.size * float(np.sum(np.log(sizes))),
        valleys,
        tuple(name for name, active in zip(_NAMES, best.active_mask, strict=True) if active),
    )


def _start(coordinates: Floats) -> Start:
    mu, temperature = np.exp(coordinates[MODEL_COORDINATES:]).tolist()
    return Start(mu, temperature)


def _bounds(scale: Scale, driven: Drive) -> tuple[Floats, Floats]:
    """Box of the coordinates: wide, and no faster than the integration follows."""
    peak = float(driven.power_w.max()) / scale.power_w
    fastest = min(5.0, 1.0 / (peak * float(np.diff(driven.time_s).max())))
    low = [0.02, 1e-3, 1e-2 * scale.power_w, 1e-5, 1e-1, 0.02, 200.0]
    high = [2.0, fastest, 1e3 * scale.power_w, 0.5, 1e4, 2.0, 1500.0]
    return np.log(low), np.log(high)


def _from_starts(
    record: Record, driven: Drive, scale: Scale, heating: Heating, weights: Floats, lower: Floats, upper: Floats
) -> tuple[OptimizeResult, int]:
    """Best minimum from all starts, and how many of those run to the end found it."""
    first = [
        _descend(record, driven, scale, heating, weights, start, lower, upper, _FIRST_EVALUATIONS)
        for start in _starts(record, driven, scale)
    ]
    first.sort(key=lambda result: float(result.cost))
    last = [_descend(record, driven, scale, heating, weights, result.x, lower, upper) for result in first[:_KEPT]]
    best = min(last, key=lambda result: float(result.cost))
    return best, sum(float(result.cost) <= (1.0 + _SAME) * float(best.cost) for result in last)


def _starts(record: Record, driven: Drive, scale: Scale) -> list[Floats]:
    """Start points, the same in every run: what the record shows at once, then spread around what pads are like."""
    firm = driven.torque_per_mu_nm > 0.2 * driven.torque_per_mu_nm.max()
    mu = float(np.median(record.torque_nm[firm] / driven.torque_per_mu_nm[firm]))
    mu = min(max(mu, 0.05), 1.5)
    rise = max(float(np.ptp(record.temperature_k)), 5.0)
    centre = np.log([mu, 0.1, scale.power_w, 0.02, rise, mu, float(record.temperature_k[0])])
    spread = np.array([0.2, 1.0, 1.2, 1.2, 0.7, 0.2, 0.01])
    rng = np.random.default_rng(_SEED)
    return [centre, *(centre + spread * rng.uniform(-1.0, 1.0, centre.size) for _ in range(STARTS - 1))]


def _descend(
    record: Record,
    driven: Drive,
    scale: Scale,
    heating: Heating,
    weights: Floats,
    start: Floats,
    lower: Floats,
    upper: Floats,
    evaluations: int = 100,
) -> OptimizeResult:
    def residual(x: Floats) -> Floats:
        course = predict(driven, scale.pad(x), _start(x), heating)
        torque = (course.torque_nm - record.torque_nm) / weights[0]
        return np.concatenate([torque, (course.temperature_k - record.temperature_k) / weights[1]])

    return least_squares(
        residual,
        np.clip(start, lower + 1e-6, upper - 1e-6),
        jac=lambda x: _sensitivity(driven, scale, heating, x, weights),
        bounds=(lower, upper),
        x_scale="jac",
        tr_solver="lsmr",
        max_nfev=evaluations,
        ftol=1e-10,
        xtol=1e-10,
        gtol=1e-12,
    )


def _sensitivity(driven: Drive, scale: Scale, heating: Heating, x: Floats, weights: Floats) -> Floats:
    """Derivative of torque and temperature, over their weights, by each coordinate; (2 n, 7)."""
    columns = []
    for i in range(x.size):
        step = np.zeros(x.size)
        step[i] = _STEP
        up = predict(driven, scale.pad(x + step), _start(x + step), heating)
        down = predict(driven, scale.pad(x - step), _start(x - step), heating)
        torque = (up.torque_nm - down.torque_nm) / (2.0 * _STEP * weights[0])
        columns.append(np.append(torque, (up.temperature_k - down.temperature_k) / (2.0 * _STEP * weights[1])))
    return np.column_stack(columns)


def _residual_sizes(record: Record, driven: Drive, scale: Scale, heating: Heating, x: Floats) -> tuple[Course, Floats]:
    """Course at ``x`` and the residuals' rms of torque, N m, and temperature, K."""
    course = predict(driven, scale.pad(x), _start(x), heating)
    torque, temperature = course.torque_nm - record.torque_nm, course.temperature_k - record.temperature_k
    sizes = np.sqrt([np.mean(torque**2), np.mean(temperature**2)])
    return course, np.maximum(sizes, _FINEST)


def _covariance(sensitivity: Floats, noises: tuple[Noise, Noise]) -> Floats:
    """Covariance of least squares under coloured noise: (J'J)^-1 J'R J (J'J)^-1, residuals scaled to size 1."""
    samples = sensitivity.shape[0] // 2
    parts = (sensitivity[:samples], sensitivity[samples:])
    information, axes = np.linalg.eigh(sensitivity.T @ sensitivity)
    information = np.maximum(information, 1e-14 * information[-1])  # a direction that shows nothing stays wide open
    bread = axes / information @ axes.T
    meat = sum(part.T @ coloured(part, noise) for part, noise in zip(parts, noises, strict=True))
    return np.asarray(bread @ meat @ bread)

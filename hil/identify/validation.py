"""Prediction of a record that the fit has not seen, as in the paper's Figure 5."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hil.identify.fit import Fit
from hil.identify.model import Brake, Course, Start, drive, predict
from hil.identify.record import Record

Floats = NDArray[np.float64]
START_S = 10.0
"""The start values of friction and temperature are taken from this much of the record; then it runs free."""


@dataclass(frozen=True)
class Error:
    """Prediction minus measurement over part of a record.

    ``torque_share`` is the rms of the torque error over the whole record's mean torque; biases are means of the error.
    """

    from_s: float
    to_s: float
    torque_rms_nm: float
    torque_bias_nm: float
    torque_share: float
    temperature_rms_k: float
    temperature_bias_k: float


@dataclass(frozen=True, eq=False)
class Validation:
    """A free-running prediction beside its record; ``whole``, then first and second half as the paper discusses."""

    record: Record
    start: Start
    course: Course
    whole: Error
    halves: tuple[Error, Error]


def validate(fit: Fit, record: Record, brake: Brake) -> Validation:
    """Run the fitted model over another record: only its first 10 s give the start values, nothing else is fitted."""
    driven = drive(record, brake)
    opening = record.time_s <= START_S

    def residual(x: Floats) -> Floats:
        course = predict(driven, fit.pad, Start(float(x[0]), float(x[1])), fit.heating)
        torque = (course.torque_nm - record.torque_nm)[opening] / fit.torque_noise.rms
        temperature = (course.temperature_k - record.temperature_k)[opening] / fit.temperature_noise.rms
        return np.concatenate([torque, temperature])

    guess = [fit.start.mu, float(record.temperature_k[0])]
    solved = least_squares(residual, guess, x_scale=[0.1, 10.0], bounds=([0.0, 200.0], [3.0, 1500.0])).x
    start = Start(float(solved[0]), float(solved[1]))
    course = predict(driven, fit.pad, start, fit.heating)
    everything = np.ones(record.time_s.size, dtype=bool)
    return Validation(record, start, course, error(record, course, everything), halves(record, course))


def halves(record: Record, course: Course) -> tuple[Error, Error]:
    """Errors of the first and of the second half of a record, as the paper discusses them."""
    late = record.time_s > 0.5 * float(record.time_s[-1])
    return error(record, course, ~late), error(record, course, late)


def error(record: Record, course: Course, part: NDArray[np.bool_]) -> Error:
    """Error of a course over part of its record."""
    torque = (course.torque_nm - record.torque_nm)[part]
    temperature = (course.temperature_k - record.temperature_k)[part]
    time = record.time_s[part]
    rms = float(np.sqrt(np.mean(torque**2)))
    return Error(
        float(time[0]),
        float(time[-1]),
        rms,
        float(torque.mean()),
        rms / float(record.torque_nm.mean()),
        float(np.sqrt(np.mean(temperature**2))),
        float(temperature.mean()),
    )

"""Phase of the wheels' hot spots, which no log states.

Takes wheel speeds, measured and simulated with weak spots at two angles; gives the angle of each wheel in each segment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import ROW_S, Recording
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from plant.effects.pads.hot_spot import ORDER
from plant.injection.theta import THETA
from plant.vectors import INPUT

_SPEEDS = INPUT.slice("wheel_speed_rad_s")
_HOT = THETA.slice("hot_spot", "amplitude")
_AMPLITUDE = 0.01
"""Amplitude of the simulated spots: some 0.1 rad/s at the wheels, where all is linear."""
QUARTER_RAD = 0.5 * np.pi / ORDER
"""A quarter of the angle from spot to spot."""
_ROWS = 5
_ONE_ANGLE, _ANGLE = 1.0, 3.0
"""Penalty of `phase_penalty`: in all, and per effective number of angles."""


def has_hot_spots(parameters: ParameterSet) -> bool:
    """True where the wheels' angles matter: a disc has hot spots."""
    return bool(np.any(parameters.theta[_HOT]))


def without_spots(parameters: ParameterSet) -> ParameterSet:
    """The parameter set with even discs."""
    theta = parameters.theta.copy()
    theta[_HOT] = 0.0
    return replace(parameters, theta=theta)


def with_spots(parameters: ParameterSet) -> ParameterSet:
    """The parameter set with weak spots on all discs, of the sign of its own."""
    theta = parameters.theta.copy()
    theta[_HOT] = np.where(theta[_HOT] < 0.0, -_AMPLITUDE, _AMPLITUDE)
    return replace(parameters, theta=theta)


def wheel_angles(recording: Recording) -> Floats:
    """Angles by which the wheels have turned since the log began, (rows, 4), rad, from their measured speeds.

    Simulated ones drift by radii and slips: a thousandth in 100 m is three radians of the tenth order.
    """
    turned = np.cumsum(recording.inputs[:, _SPEEDS] * ROW_S, axis=0)
    return np.concatenate([np.zeros((1, 4)), turned])[:-1]


def row_chunks(rows: slice) -> Iterator[slice]:
    """Rows in chunks short enough for a simulated wheel to turn as the measured one."""
    for first in range(rows.start, rows.stop, _ROWS):
        yield slice(first, min(first + _ROWS, rows.stop))


def fit_phase(recording: Recording, residual: Floats, signatures: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Phase of the spots by least squares on the wheels' speeds, and how much they would show.

    Differences from sample to sample are fitted: what is slow says nothing of the tenth order.

    Parameters
    ----------
    residual : (samples, 4), measured less simulated without spots, rad/s.
    signatures : two of (samples, 4), what weak spots add at angle 0 and at `QUARTER_RAD`.

    Returns
    -------
    Angles, (rows, 4), rad, constant in each segment; norms of the signatures, (segments, 4).
    """
    angles, visibility = np.zeros((len(recording.inputs), 4)), np.zeros((len(recording.segments), 4))
    for number, segment in enumerate(recording.segments):
        within = slice(segment.first // recording.stride, segment.last // recording.stride)
        moving = (recording.moving[within][1:] > 0.5) & (recording.moving[within][:-1] > 0.5)
        for k in range(4):
            steps = [np.diff(values[within, k]) for values in (residual, *signatures)]
            known = moving & np.isfinite(steps[0])
            columns = np.column_stack([values[known] for values in steps[1:]])
            if not columns.any():
                continue
            visibility[number, k] = np.linalg.norm(columns)
            sine, cosine = np.linalg.lstsq(columns, steps[0][known], rcond=None)[0]
            angles[segment.first : segment.last, k] = np.arctan2(cosine, sine) / ORDER
    return angles, visibility


def phase_penalty(visibility: Floats, wheels: Sequence[int]) -> float:
    """Penalty on the gain of spots on these wheels for angles chosen by the data; ``visibility`` as of `fit_phase`.

    Spots that show alike in N segments and wheels: noise turns each to where it looks like spots, and (sum of N
    Rayleigh variables)^2 / N exceeds this and 20 as seldom as chi-squared with one degree of freedom exceeds 20 (by
    convolution: 3.5, 13.9, 25.5 and 36.0 for N of 1, 4, 8 and 12). Where they show unlike, N is that of Kish (1965,
    Survey Sampling), with the visibilities as weights.
    """
    weights = visibility[:, list(wheels)]
    squares = float(np.sum(weights**2))
    return _ONE_ANGLE + _ANGLE * float(weights.sum()) ** 2 / squares if squares else 0.0

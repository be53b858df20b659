"""Where the wheels' hot spots stand: angles as measured, from where no log tells."""

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
_SHOWN = 0.01
"""Amplitude of the replays that show where the spots stand: some 0.1 rad/s at the wheels, where all is linear."""
QUARTER_RAD = 0.5 * np.pi / ORDER
"""A quarter of the way from spot to spot."""
_ROWS = 5
_ONE_ANGLE, _ANGLE = 1.0, 3.0


def has_hot_spots(world: ParameterSet) -> bool:
    """Whether angles of the wheels matter beyond a turn or two."""
    return bool(np.any(world.theta[_HOT]))


def without_spots(world: ParameterSet) -> ParameterSet:
    """The world with even discs."""
    theta = world.theta.copy()
    theta[_HOT] = 0.0
    return replace(world, theta=theta)


def with_spots(world: ParameterSet) -> ParameterSet:
    """The world with weak spots on all discs, of the sign of its own."""
    theta = world.theta.copy()
    theta[_HOT] = np.where(theta[_HOT] < 0.0, -_SHOWN, _SHOWN)
    return replace(world, theta=theta)


def wheel_angles(drive: Recording) -> Floats:
    """Angles by which the wheels have turned since the log began, (rows, 4), rad, from their measured speeds.

    A free replay drifts by radii and slips: a thousandth in 100 m is three radians of the tenth order.
    """
    turned = np.cumsum(drive.inputs[:, _SPEEDS] * ROW_S, axis=0)
    return np.concatenate([np.zeros((1, 4)), turned])[:-1]


def row_chunks(rows: slice) -> Iterator[slice]:
    """Rows in parts short enough for a simulated wheel to turn as the measured one."""
    for first in range(rows.start, rows.stop, _ROWS):
        yield slice(first, min(first + _ROWS, rows.stop))


def fit_phase(drive: Recording, left: Floats, shown: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Angle between spots and the begin of each segment, (rows, 4), rad: where they explain the wheels' speeds best;
    and how much they would show there, (segments, 4).

    ``left`` (samples, 4) is what a replay without spots leaves, ``shown`` what spots at no angle and at a quarter do.
    Samples differ from one to the next: what is slow says nothing of the tenth order.
    """
    found, much = np.zeros((len(drive.inputs), 4)), np.zeros((len(drive.segments), 4))
    for number, segment in enumerate(drive.segments):
        within = slice(segment.first // drive.stride, segment.last // drive.stride)
        known = (drive.moving[within][1:] > 0.5) & (drive.moving[within][:-1] > 0.5)
        for k in range(4):
            steps = [np.diff(values[within, k]) for values in (left, *shown)]
            good = known & np.isfinite(steps[0])
            of = np.column_stack([values[good] for values in steps[1:]])
            if not of.any():
                continue
            much[number, k] = np.linalg.norm(of)
            sine, cosine = np.linalg.lstsq(of, steps[0][good], rcond=None)[0]
            found[segment.first : segment.last, k] = np.arctan2(cosine, sine) / ORDER
    return found, much


def phase_penalty(much: Floats, wheels: Sequence[int]) -> float:
    """What angles chosen by the data take off the gain of spots on these wheels, (segments, 4) as of `fit_phase`.

    Spots show in N segments and wheels alike much, and noise turns each to where it looks like spots: (sum of N
    Rayleigh variables)^2 / N exceeds this and 20 as seldom as chi-squared with one degree of freedom exceeds 20 (by
    convolution: 3.5, 13.9, 25.5 and 36.0 for N of 1, 4, 8 and 12). Where they show unlike much N is that of Kish (1965,
    Survey Sampling), weighed by the root of the sum of squares they show: so the variables are, in the sum.
    """
    of = much[:, list(wheels)]
    squares = float(np.sum(of**2))
    return _ONE_ANGLE + _ANGLE * float(of.sum()) ** 2 / squares if squares else 0.0

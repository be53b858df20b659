"""Whether a car was kept straight: no log tells the steering wheel, and none that it turned."""

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.data.log import Floats, Log

_OVER_S, _TURNS_RAD_S = 0.5, 0.003
"""A mean of the yaw rate over so long, beside its median, that is no turning: 0.2 deg/s, what a bend of 7 km asks at
72 km/h."""


def is_straight_line(logs: Sequence[Log]) -> bool:
    """Whether a driver who is not seen held the car on its line, against whatever pulls to one side.

    A steering wheel that is in no log, or in all of them one number, was not held still: brakes that pull are steered
    against. Where the yaw rate tells of turning the car is left free.
    """
    return not any(_steered(log) or _turns(log) for log in logs)


def _steered(log: Log) -> bool:
    angle = log.channels.get("steer_rad")
    return angle is not None and bool(np.isfinite(angle).any()) and float(np.nanmax(angle) - np.nanmin(angle)) > 0.0


def _turns(log: Log) -> bool:
    rate = log.channels.get("yaw_rate_rad_s")
    if rate is None:
        return False
    good = np.isfinite(rate)
    told: Floats = rate[good]
    if len(told) < 2:
        return False
    over = max(int(_OVER_S / max(float(np.median(np.diff(log.t_s[good]))), 1e-3)), 1)
    noise = 1.48 * float(np.median(np.abs(np.diff(told)))) / np.sqrt(2.0 * over)
    smooth = np.convolve(told - np.median(told), np.ones(over) / over, mode="valid")
    return bool(np.abs(smooth).max(initial=0.0) > max(_TURNS_RAD_S, 5.0 * noise))

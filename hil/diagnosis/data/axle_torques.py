"""Motors at one axle alone: logs that tell torques of two wheels."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, Log

_FRONT, _REAR = {*MOTOR_TORQUE[:2], *MOTOR_DEMAND[:2]}, {*MOTOR_TORQUE[2:], *MOTOR_DEMAND[2:]}


def with_both_axles(logs: Sequence[Log]) -> Sequence[Log]:
    """Logs of a car that has motors at one axle, with no torque at the other.

    So it is where every log tells of both wheels of one axle, and none of any of the other's.
    """
    told = set().union(*(log.channels for log in logs)) & (_FRONT | _REAR)
    groups = [group for group in (MOTOR_TORQUE, MOTOR_DEMAND) if told & {*group}]
    of_one = told <= _FRONT or told <= _REAR
    if not (told and of_one and len(told) == 2 * len(groups) and all(log.has(*told) for log in logs)):
        return logs
    said = f"no torque of motors is told at the {'rear' if told <= _FRONT else 'front'}: it is taken to have none"
    none = {name for group in groups for name in group} - told
    return [
        replace(
            log,
            channels={**log.channels, **{name: np.zeros(len(log.t_s)) for name in sorted(none)}},
            remarks=(*log.remarks, said),
        )
        for log in logs
    ]


def undriven(logs: Iterable[Log]) -> set[int]:
    """Wheels of one axle whose motors, as told and as asked, never do anything in logs where those of the other do."""
    driven = {
        k
        for log in logs
        for names in (MOTOR_TORQUE, MOTOR_DEMAND)
        for k, name in enumerate(names)
        if name in log.channels and np.any(np.nan_to_num(log.channels[name]))
    }
    return {2, 3} if driven and driven <= {0, 1} else {0, 1} if driven and driven <= {2, 3} else set()

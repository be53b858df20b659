"""Cars with motors at one axle: logs with the torques of two wheels."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, Log

_FRONT, _REAR = {*MOTOR_TORQUE[:2], *MOTOR_DEMAND[:2]}, {*MOTOR_TORQUE[2:], *MOTOR_DEMAND[2:]}


def with_both_axles(logs: Sequence[Log]) -> Sequence[Log]:
    """Logs of a car with motors at one axle, with zero torque added at the other; other logs as they are.

    It is such a car if every log has the torques of both wheels of one axle, and none has any of the other axle.
    """
    logged = set().union(*(log.channels for log in logs)) & (_FRONT | _REAR)
    groups = [group for group in (MOTOR_TORQUE, MOTOR_DEMAND) if logged & {*group}]
    one_axle = logged <= _FRONT or logged <= _REAR
    if not (logged and one_axle and len(logged) == 2 * len(groups) and all(log.has(*logged) for log in logs)):
        return logs
    remark = f"no motor torque is logged at the {'rear' if logged <= _FRONT else 'front'}: taken as zero there"
    zero = {name for group in groups for name in group} - logged
    return [
        replace(
            log,
            channels={**log.channels, **{name: np.zeros(len(log.t_s)) for name in sorted(zero)}},
            remarks=(*log.remarks, remark),
        )
        for log in logs
    ]


def undriven(logs: Iterable[Log]) -> set[int]:
    """Wheels of the axle without motors: torques and demands are always zero there and not at the other; else none."""
    driven = {
        k
        for log in logs
        for names in (MOTOR_TORQUE, MOTOR_DEMAND)
        for k, name in enumerate(names)
        if name in log.channels and np.any(np.nan_to_num(log.channels[name]))
    }
    return {2, 3} if driven and driven <= {0, 1} else {0, 1} if driven and driven <= {2, 3} else set()

"""Wheels whose pressure or torque has no values: they cost themselves, not the whole car's."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, Log

_MATE = (1, 0, 3, 2)
"""The other wheel of the axle, by wheel."""
_GROUPS = (PRESSURE, PRESSURE_DEMAND, MOTOR_TORQUE, MOTOR_DEMAND)
_AXLE = {0: "front", 1: "front", 2: "rear", 3: "rear"}


def with_paired_wheels(logs: Sequence[Log]) -> Sequence[Log]:
    """Logs in which a wheel without values of pressure or torque has those of the other wheel of its axle.

    Other wheels stay as they are; what is another wheel's is never compared with it (`Log.copied`).
    """
    used = {name for log in logs for name in log.channels}
    return [_paired(log, used) for log in logs]


def _paired(log: Log, used: set[str]) -> Log:
    for group in _GROUPS:
        missing = [k for k, name in enumerate(group) if not _has_values(log, name)]
        # an axle without motors has no torque in any log: that is not a failed sensor
        failed = [k for k in missing if _has_values(log, group[_MATE[k]])]
        for k in failed:
            name, mate = group[k], group[_MATE[k]]
            log = replace(
                log,
                channels={**log.channels, name: np.asarray(log.channels[mate]).copy()},
                copied=log.copied | {name},
                remarks=(
                    *log.remarks,
                    f"{name} has no values: taken as {mate}; left and right are not compared at the {_AXLE[k]}",
                ),
            )
        lost = [group[k] for k in missing if k not in failed]
        if lost and len(lost) < 4 and any(name in used for name in lost):
            remark = f"{', '.join(lost)} have no values in this log and are used in none of the logs"
            log = replace(log, remarks=(*log.remarks, remark))
    return log


def _has_values(log: Log, name: str) -> bool:
    return name in log.channels and bool(np.isfinite(log.channels[name]).any())


def copied_axles(log: Log, kind: str) -> list[str]:
    """Axles with a copied channel, ``front`` and ``rear``; ``kind`` is ``pressure`` or ``motor``."""
    groups = (PRESSURE, PRESSURE_DEMAND) if kind == "pressure" else (MOTOR_TORQUE, MOTOR_DEMAND)
    return sorted({_AXLE[k] for group in groups for k, name in enumerate(group) if name in log.copied})

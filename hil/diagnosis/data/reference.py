"""Reference logs beside those to be explained: whether both can be compared, and with which channels.

Takes logs of both; gives both with the channels that they share. What only one of them has is said and left out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.data.dataset import SLOW_MPS
from hil.diagnosis.data.log import (
    MOTOR_DEMAND,
    MOTOR_TORQUE,
    PRESSURE,
    PRESSURE_DEMAND,
    WHEEL_SPEED,
    Log,
    UnusableError,
)

_BRAKED_PA, _BRAKED_S = 2e5, 1.0
"""Pressure, and the time above it while the car moves, of braking that tells of the brakes."""
_CHOSEN = (PRESSURE, PRESSURE_DEMAND, MOTOR_TORQUE, MOTOR_DEMAND)
"""Channels of all four wheels, which are used together."""


def with_shared_channels(
    logs: Sequence[Log], reference: Sequence[Log], radius_m: float
) -> tuple[list[Log], list[Log], list[str]]:
    """Both with the channels that all of them have, and remarks on what is left out.

    Parameters
    ----------
    radius_m : rolling radius, for a speed by the wheels.

    Raises
    ------
    UnusableError
        The same recording is in both; they share no speed or no force; only the other logs brake.
    """
    _refuse_the_same(logs, reference)
    of_logs, of_reference = _channels(logs), _channels(reference)
    remarks = []
    for where, missing in (
        ("the reference", sorted(of_logs - of_reference)), ("the logs since", sorted(of_reference - of_logs)),
    ):  # fmt: skip
        if missing:
            remarks.append(f"not in {where}, so left out of the comparison: {', '.join(missing)}")
    shared = of_logs & of_reference
    if not shared & {*WHEEL_SPEED, "speed_mps"}:
        raise UnusableError(_without("speed (wheel_speed_..._rad_s or speed_mps)", of_logs, of_reference))
    if not any({*names} <= shared for names in _CHOSEN):
        raise UnusableError(_without("brake pressure or motor torque of all wheels", of_logs, of_reference))
    if _braked_s(logs, radius_m) >= _BRAKED_S and _braked_s(reference, radius_m) < _BRAKED_S:
        raise UnusableError(
            f"--reference: its logs brake for {_braked_s(reference, radius_m):.1f} s, expected {_BRAKED_S:g} s or more "
            f"above {_BRAKED_PA / 1e5:g} bar, as in the logs to be explained; add reference logs with stops"
        )
    only = {name for log in (*logs, *reference) for name in log.channels} - shared
    return _with_only(logs, only), _with_only(reference, only), remarks


def _refuse_the_same(logs: Sequence[Log], reference: Sequence[Log]) -> None:
    for one in logs:
        for other in reference:
            if one is other or _same_recording(one, other):
                raise UnusableError(
                    f"--reference: {other.name} is the same recording as {one.name} of the logs to be explained; "
                    "give drives from before something changed as the reference, and those after it as logs"
                )


def _same_recording(one: Log, other: Log) -> bool:
    if len(one.t_s) != len(other.t_s) or set(one.channels) != set(other.channels):
        return False
    return all(np.array_equal(one.channels[name], other.channels[name], equal_nan=True) for name in one.channels)


def _channels(logs: Sequence[Log]) -> set[str]:
    return set.intersection(*(set(log.channels) for log in logs))


def _with_only(logs: Sequence[Log], left_out: set[str]) -> list[Log]:
    return [
        replace(log, channels={name: values for name, values in log.channels.items() if name not in left_out})
        for log in logs
    ]


def _without(what: str, of_logs: set[str], of_reference: set[str]) -> str:
    return (
        f"--reference: no {what} in both; the reference has {', '.join(sorted(of_reference))}, the logs to be "
        f"explained have {', '.join(sorted(of_logs))}; give reference logs with the channels of these"
    )


def _braked_s(logs: Sequence[Log], radius_m: float) -> float:
    """Time on the brakes while the car moves, s."""
    total = 0.0
    for log in logs:
        names = next((names for names in (PRESSURE, PRESSURE_DEMAND) if log.has(*names)), None)
        speeds = [log.channels["speed_mps"]] if log.has("speed_mps") else []
        speeds += [radius_m * log.channels[name] for name in WHEEL_SPEED if log.has(name)]
        if names is None or not speeds:
            continue
        pressure = np.nanmax(np.nan_to_num([log.channels[name] for name in names]), axis=0)
        moves = np.nanmax(np.nan_to_num(speeds), axis=0) > SLOW_MPS
        total += float((moves & (pressure > _BRAKED_PA)).sum()) * float(np.median(np.diff(log.t_s)))
    return total

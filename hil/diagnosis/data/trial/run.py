"""The trial of the inputs: refuses what can only be wrong, moves what comes far too late, gives the lags it saw."""

from collections.abc import Sequence
from dataclasses import replace

from hil.diagnosis.data.log import Log, UnusableError
from hil.diagnosis.data.trial.finding import Finding
from hil.diagnosis.data.trial.forces import forces
from hil.diagnosis.data.trial.lateral import lateral
from hil.diagnosis.data.trial.motion import Car, Motion, motion_of
from hil.diagnosis.data.trial.scales import all_scales
from hil.diagnosis.data.trial.stamps import late, moved, stamps


def on_trial(logs: Sequence[Log], car: Car, simulated: bool = True) -> list[Log]:
    """Logs that passed, with the lags of their channels, and with remarks on what was seen.

    Parameters
    ----------
    car : `hil.diagnosis.vehicle.trial_car.car_of`.
    simulated : False where sensors are compared with the motion, which names a wrong scale, sign or stamp of a sensor
        as a cause: these are no refusal then.

    Raises
    ------
    UnusableError
        A channel in another unit, with a turned sign, or with stamps that contradict the others.
    """
    refused: list[tuple[str, Finding]] = []
    passed = []
    for log in logs:
        log, found = _one(log, car, simulated)
        passed.append(log)
        refused += [(log.name, one) for one in found]
    if refused:
        raise UnusableError(_message(refused))
    return passed


def _one(log: Log, car: Car, simulated: bool) -> tuple[Log, list[Finding]]:
    """A log as it goes on, and what refuses it."""
    motion = motion_of(log, car)
    found = all_scales(motion)
    if all(one.channels == ("ax_mps2",) for one in found):  # else the speed itself, which the others need, is wrong
        found = [*found, *lateral(motion), *forces(motion)]
    log, more = _stamps(log, motion, simulated and not found)
    found = [*found, *more]
    fatal = [one for one in found if one.certain and (simulated or not one.names_itself)]
    remarks = [one.text for one in found if one not in fatal]
    return replace(log, remarks=(*log.remarks, *remarks)), fatal


def _stamps(log: Log, motion: Motion, complain: bool) -> tuple[Log, list[Finding]]:
    """The log with the lags of its channels, the one that is far too late moved."""
    seen = stamps(motion)
    verdict = late(motion, seen)
    log = replace(log, read=tuple(replace(one, lag_s=seen.channels.get(one.channel)) for one in log.read))
    if isinstance(verdict, tuple):
        return moved(log, motion, verdict[0], verdict[1], seen), []
    return log, [verdict] if verdict is not None and complain else []


def _message(refused: Sequence[tuple[str, Finding]]) -> str:
    """One line a contradiction, with all the logs that show it."""
    by_channels: dict[tuple[tuple[str, ...], str], list[tuple[str, Finding]]] = {}
    for name, one in refused:
        by_channels.setdefault((one.channels, one.advice), []).append((name, one))
    lines = []
    for same in by_channels.values():
        name, one = same[0]
        more = f" (and {len(same) - 1} more log{'s' if len(same) > 2 else ''})" if len(same) > 1 else ""
        lines.append(f"{name}{more}: {one.text}")
    return "\n".join(lines)

"""`calibrate`: the numbers of a vehicle set fitted to reference logs by the engine of `explain`, no cause allowed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from dbc.database import parse_database
from hil.diagnosis.calibration.fitted_set import Fit, FittedNumber, fitted_numbers
from hil.diagnosis.data.axle_torques import with_both_axles
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import Floats, Log, UnusableError
from hil.diagnosis.data.masks import is_straight_line
from hil.diagnosis.data.paired_wheels import with_paired_wheels
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.data.trial.run import on_trial
from hil.diagnosis.detection.result import Diagnosis, Progress, Settings
from hil.diagnosis.detection.stepwise import diagnose
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.explain import shipped
from hil.diagnosis.result.cross_validation import HeldOutError, folds, held_out_error
from hil.diagnosis.sensor_consistency.check import why_not_simulatable
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.load import load_vehicle, read_set
from hil.diagnosis.vehicle.spec import Vehicle
from hil.diagnosis.vehicle.trial_car import car_of


@dataclass(frozen=True, eq=False)
class Calibration:
    """A fitted set.

    Attributes
    ----------
    table : the new set, key by key; what was not fitted is as it was.  numbers : what was fitted, farthest first.
    errors : root mean square error of each channel, nominal and held out.
    left : the best listed effect, and how much it gains over what it had to, where the fitted car does not explain the
        reference; empty otherwise.
    remarks : on the logs, the set and what moved that no key states.
    """

    table: dict[str, Any]
    numbers: Sequence[FittedNumber]
    errors: Sequence[HeldOutError]
    left: str
    remarks: tuple[str, ...]
    logs: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """What ``brakebench calibrate --json`` prints, without the file written."""
        errors = {
            one.channel: {"before": one.before, "after": one.after, "ci95": [one.low, one.high]} for one in self.errors
        }
        return {
            "logs": list(self.logs), "numbers": [one.as_json() for one in self.numbers], "held_out_error": errors,
            "left_in_reference": self.left or None, "remarks": list(self.remarks),
        }  # fmt: skip


def calibrate(
    logs: Sequence[Path | Log], vehicle: Path, channel_map: Path | None = None, database: Path | None = None,
    about: Path | None = None, progress: Progress | None = None,
) -> Calibration:  # fmt: skip
    """Fit a vehicle set to drives of the car.

    Parameters
    ----------
    logs : reference drives.  vehicle : its set, a file or the name of a shipped car.
    channel_map, database, about : as in `hil.diagnosis.explain.explain`.
    progress : called with one line of text a step.

    Raises
    ------
    UnusableError
        Logs or set that cannot be used; logs without forces; a fitted number that no car has.
    """
    report = progress or (lambda _: None)
    file = shipped(Path(vehicle), "vehicle")
    table, car = read_set(file), load_vehicle(file)
    radius_m = float(car.parameters.wheel.rolling_radius_m)
    read = with_both_axles(with_paired_wheels(_read(logs, car, channel_map, database, about)))
    if why := why_not_simulatable(read, radius_m):
        raise UnusableError(f"{read[0].name}: {why}; a vehicle set is fitted by simulation")
    read = on_trial(read, car_of(car))
    car = (car.without_lateral_dynamics() if is_straight_line(read) else car).with_motor_limits_from(read)
    dataset = prepare(read, radius_m, car.unstated)
    with threadpool_limits(1, "blas"):  # simulations fill the processors
        diagnosis = diagnose(dataset, car, nominal(car), Settings(most_causes=0, dictionary=False), report)
        report("held-out error by cross-validation")
        errors = held_out_error(diagnosis)
    model, fitter = diagnosis.base, diagnosis.fitter
    fit = Fit(fitter.base, fitter.nuisances, np.asarray(model.z), standard_deviations(diagnosis))
    numbers, others = fitted_numbers(fit, car, table)
    new = with_numbers(table, numbers)
    refuse_impossible(new)
    remarks = [*car.remarks, *(f"{one.log.name}: {text}" for one in dataset.recordings for text in one.log.remarks)]
    if others:
        remarks.append(f"moved, and no key of a set states it, so fitted anew each time: {', '.join(others)}")
    names = tuple(one.log.name for one in dataset.recordings)
    return Calibration(new, numbers, errors, _left(diagnosis), tuple(remarks), names)


def _read(
    logs: Sequence[Path | Log], car: Vehicle, channel_map: Path | None, database: Path | None, about: Path | None
) -> list[Log]:
    mapped = (
        None
        if channel_map is None
        else load_map(shipped(Path(channel_map), "map"), float(car.parameters.wheel.rolling_radius_m))
    )
    dbc = None if database is None else parse_database(Path(database).read_bytes(), str(database))
    constant = float(car.parameters.motor.torque_constant_nm_a)
    read: list[Log] = []
    for item in logs:
        read += [item] if isinstance(item, Log) else read_logs([Path(item)], dbc, mapped, about, constant)
    return read


def standard_deviations(diagnosis: Diagnosis) -> Floats:
    """(nuisances,) standard deviation of each after the fit, in those of the prior; at most that one.

    The larger one of the information matrix's and of a jackknife over four folds of the manoeuvres: the former trusts
    the noise model, the latter asks whether the manoeuvres agree.
    """
    fitter, model, noise = diagnosis.fitter, diagnosis.base, diagnosis.first_noise
    information = fitter.nuisance_information(noise)
    formal = np.sqrt(np.diag(np.linalg.inv(information + np.eye(len(information)))))
    blocks = information_blocks(model.residual, fitter.nuisance_jacobian, fitter.masks, noise, len(fitter.nuisances))
    parts = [fitter.moved(model, blocks.total(weights))[0] for weights in folds(fitter.masks)]
    count = len(parts)
    spread = np.std(parts, axis=0) * np.sqrt(count - 1.0) if count > 1 else np.zeros(len(formal))
    return np.asarray(np.clip(np.maximum(formal, spread), 1e-3, 1.0))


def with_numbers(table: Mapping[str, Any], numbers: Sequence[FittedNumber]) -> dict[str, Any]:
    """The set with fitted values and tolerances in their places, new keys at the end; all else as it was."""
    new = {key: value for key, value in table.items() if key != "required"}
    for one in numbers:
        new[one.key] = one.after
        new[f"{one.key}_tolerance"] = one.tolerance_after
    ordered: dict[str, Any] = {}
    for key in new:  # each tolerance behind its value
        stem = key.removesuffix("_tolerance")
        if key != stem and stem in new:
            continue
        ordered[key] = new[key]
        if f"{key}_tolerance" in new:
            ordered[f"{key}_tolerance"] = new[f"{key}_tolerance"]
    return ordered


def refuse_impossible(table: Mapping[str, Any]) -> None:
    """Refuse a set with a number beyond the bounds of road vehicles or of the plant.

    Raises
    ------
    UnusableError
        With the key and its bounds.
    """
    try:
        load_vehicle(table)
    except UnusableError as error:
        raise UnusableError(
            f"nothing is written: the fit leads to a number that no car has ({error}); the logs contradict the set, or "
            "something is wrong with a channel: see what `explain` names"
        ) from error


def _left(diagnosis: Diagnosis) -> str:
    """The best listed effect that the fitted car leaves in the reference beyond the threshold; empty where none is."""
    best = max(diagnosis.scores, key=lambda one: one.gain, default=None)
    if best is None or best.gain < diagnosis.detection_threshold:
        return ""
    return f"{best.candidate.name}, {best.gain:.0f} in chi-squared where {diagnosis.detection_threshold:.0f} count"

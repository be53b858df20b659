"""`explain`: takes measured logs and a vehicle set, gives the answer. The call behind ``brakebench explain``."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar, cast

from threadpoolctl import threadpool_limits

from dbc.database import parse_database
from hil.diagnosis.data.axle_torques import with_both_axles
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import Log, UnusableError
from hil.diagnosis.data.masks import is_straight_line
from hil.diagnosis.data.paired_wheels import with_paired_wheels
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import from_frame, read_logs
from hil.diagnosis.data.reference import with_shared_channels
from hil.diagnosis.data.trial.run import on_trial
from hil.diagnosis.detection.result import Progress, Settings
from hil.diagnosis.detection.stepwise import diagnose
from hil.diagnosis.manoeuvres.coast_down import CoastDown, coast_down
from hil.diagnosis.manoeuvres.stop_figures import StopFigures, stop_figures
from hil.diagnosis.manoeuvres.stops import stops_of
from hil.diagnosis.result.answer import Answer, answer
from hil.diagnosis.result.cross_validation import confirmed, held_out_error
from hil.diagnosis.result.extended_car import extended_car, write_extended_car
from hil.diagnosis.result.goodness_of_fit import goodness_of_fit
from hil.diagnosis.result.residual_patterns import residual_patterns
from hil.diagnosis.sensor_consistency.check import Consistency, check, why_not_simulatable
from hil.diagnosis.sensor_consistency.motion import measured_channels
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.spec import Vehicle
from hil.diagnosis.vehicle.trial_car import car_of

_SHIPPED_CAR = "paper_car"
"""Name of the vehicle set that our own recordings are of."""
_UNSTATED = "no vehicle is given: taken as the car that comes with brakebench"

_Function = TypeVar("_Function", bound=Callable[..., Any])
_limited = threadpool_limits.wrap(limits=1, user_api="blas")
_on_one_thread = cast(Callable[[_Function], _Function], _limited)
"""Linear algebra of a function on one thread: simulations fill the processors, and a thread beside them only waits."""

_INERTIAL = {"ax_mps2", "ay_mps2", "yaw_rate_rad_s"}
"""Channels that can be compared with the motion."""


@_on_one_thread
def explain(
    logs: Any, vehicle: Path | str | Mapping[str, Any] | None = None, *, channel_map: Path | None = None,
    database: Path | None = None, about: Path | None = None, extend: Path | None = None, out: Path | None = None,
    reference: Any = None, settings: Settings | None = None, progress: Progress | None = None,
) -> Answer | Consistency | CoastDown | StopFigures:  # fmt: skip
    """Find what the simulation gets wrong in measured data, name its cause, extend the model and measure the gain.

    Where no force was measured, or none that propels the car, no simulation is possible: the sensors are compared with
    the car's own motion (`hil.diagnosis.sensor_consistency`); the remarks say so. Logs of a speed alone in which the
    car coasts give its road load (`hil.diagnosis.manoeuvres.coast_down`), stops by speed alone their figures.

    Parameters
    ----------
    logs : a data frame (or mapping of columns) in the canonical table, a path, or a list of either.
    vehicle : flat vehicle set as a file or mapping; None is the shipped car, for our own recordings alone.
    channel_map, database, about : another car's channel map, its DBC, and ``logs.toml``.
    extend : extension file whose model is the starting point.
    out : folder for the extension file; without it none is written.
    reference : logs of the same car from before something changed, given as ``logs``: what has changed is explained.
    settings : parts to switch off, for tests.  progress : called with one line of text a step.

    Raises
    ------
    hil.diagnosis.data.log.UnusableError
        Data or files that permit no conclusion: the message says why.
    """
    report = progress or (lambda _: None)
    folder = None if out is None else Path(out)
    car = vehicle_of(vehicle)
    radius_m = float(car.parameters.wheel.rolling_radius_m)

    def given(items: Any) -> list[Log]:
        return logs_of(items, car, channel_map, database, about, vehicle is not None)

    read = given(logs)
    before = [] if reference is None else _named_reference(given(reference))
    if vehicle is None:
        refuse_another_car([*read, *before])
    if reference is not None:
        read, before, notes = with_shared_channels(read, before, radius_m)
        _refuse_unsimulated([*before, *read], car)
        both = on_trial([*before, *read], car_of(car))
        return _simulated(both, car, extend, folder, settings, report, len(before), notes)
    is_inertial = bool(measured_channels(read) & _INERTIAL)
    coasting = coast_down(read, car, extend, None if is_inertial else folder)
    stops = [stop.as_json() for stop in stops_of(read, radius_m)]
    if coasting is not None and not is_inertial:
        return replace(coasting, json=coasting.json | {"stops": stops})
    why = why_not_simulatable(read, radius_m)
    read = on_trial(read, car_of(car), simulated=not why)
    if why:
        road_load = {} if coasting is None else {"coast_down": coasting.json["coast_down"]}
        compared = check(read, car, why, extend, folder, report)
        return replace(compared, json=compared.json | {"stops": stops} | road_load)
    if (figures := stop_figures(read, car, stops)) is not None:
        return figures
    return _simulated(read, car, extend, folder, settings, report)


def _simulated(
    logs: Sequence[Log], car: Vehicle, extend: Path | None, folder: Path | None, settings: Settings | None,
    report: Progress, reference: int = 0, notes: Sequence[str] = (),
) -> Answer:  # fmt: skip
    """The answer by simulation; the first ``reference`` logs are what the others are compared with."""
    radius_m = float(car.parameters.wheel.rolling_radius_m)
    stops = [stop.as_json() for stop in stops_of(logs[reference:], radius_m)]
    car = (car.without_lateral_dynamics() if is_straight_line(logs) else car).with_motor_limits_from(logs)
    dataset = prepare(logs, radius_m, car.unstated)
    base, of_extension = (nominal(car), []) if extend is None else extended_car(car, Path(extend), dataset)
    diagnosis = diagnose(dataset, car, base, settings, report, reference)
    report("held-out error by cross-validation")
    diagnosis = confirmed(diagnosis, report)
    errors, patterns = held_out_error(diagnosis), residual_patterns(diagnosis)
    fits = goodness_of_fit(diagnosis)
    extension = None if folder is None else write_extended_car(diagnosis, folder)
    of_logs = (f"{one.log.name}: {text}" for one in dataset.recordings for text in one.log.remarks)
    remarks = [*notes, *car.remarks, *of_extension, *of_logs, *diagnosis.remarks]
    found = answer(diagnosis, errors, patterns, fits, extension, remarks, folder)
    return replace(found, json=found.json | {"stops": stops})


def shipped(path: Path, kind: str) -> Path:
    """A file, or, by the name of a car, the file that comes with brakebench; ``kind`` is ``map`` or ``vehicle``."""
    ours = Path(str(resources.files("hil.diagnosis") / "cars" / f"{path.name}.{kind}.toml"))
    return ours if not path.suffix and not path.exists() and ours.exists() else path


def vehicle_of(vehicle: Path | str | Mapping[str, Any] | None) -> Vehicle:
    """The vehicle of a set, given as `explain` takes it."""
    if vehicle is None or str(vehicle) == _SHIPPED_CAR:
        return load_vehicle(None)
    return load_vehicle(shipped(Path(vehicle), "vehicle") if isinstance(vehicle, str | Path) else vehicle)


def _named_reference(logs: Sequence[Log]) -> list[Log]:
    """Reference logs by names that tell them from the others."""
    return [replace(log, name=f"reference {log.name}") for log in logs]


def _refuse_unsimulated(logs: Sequence[Log], car: Vehicle) -> None:
    """Refuse a comparison of logs that no simulation can follow."""
    radius_m = float(car.parameters.wheel.rolling_radius_m)
    why = why_not_simulatable(logs, radius_m)
    if why or stop_figures(logs, car, []) is not None:
        raise UnusableError(
            f"--reference: expected logs that can be simulated, got {why or 'speeds alone'}; give logs with measured "
            "or demanded brake pressures or motor torques, or leave --reference out"
        )


def refuse_another_car(logs: Sequence[Log]) -> None:
    """Refuse files that nobody said whose they are: only recordings of our own bus are of the shipped car."""
    others = [log.name for log in logs if log.another_car]
    if others:
        more = f" and {len(others) - 1} more" if len(others) > 1 else ""
        raise UnusableError(
            f"{others[0]}{more}: not a recording of brakebench's own bus and no vehicle is given; its numbers (mass, "
            "rolling radius, brake gains) decide what counts as wrong: give --vehicle SET.toml with mass_kg, "
            "wheelbase_m, cog_to_front_axle_m, rolling_radius_m, brake_gain_front_nm_pa and brake_gain_rear_nm_pa "
            f"(docs/vehicle-set.md), or --vehicle {_SHIPPED_CAR} if it is the car that comes with brakebench"
        )


def logs_of(
    logs: Any, car: Vehicle, channel_map: Path | None, database: Path | None, about: Path | None, stated: bool
) -> list[Log]:
    """Logs given as `explain` takes them; ``stated`` where a vehicle set was given."""
    return list(with_both_axles(with_paired_wheels(_read(logs, car, channel_map, database, about, stated))))


def _read(
    logs: Any, car: Vehicle, channel_map: Path | None, database: Path | None, about: Path | None, stated: bool
) -> list[Log]:
    items = list(logs) if isinstance(logs, list | tuple) else [logs]
    mapped = (
        None
        if channel_map is None
        else load_map(shipped(Path(channel_map), "map"), float(car.parameters.wheel.rolling_radius_m))
    )
    dbc = None
    if database is not None:
        dbc = parse_database(Path(database).read_bytes(), str(database))
    constant = float(car.parameters.motor.torque_constant_nm_a)
    read: list[Log] = []
    for k, item in enumerate(items):
        if isinstance(item, Log):
            read.append(item)
        elif isinstance(item, str | Path):
            read += read_logs([Path(item)], dbc, mapped, None if about is None else Path(about), constant)
        else:
            frame = from_frame(item, f"dataframe {k}" if len(items) > 1 else "dataframe")
            read.append(frame if stated else replace(frame, remarks=(*frame.remarks, _UNSTATED)))
    return read

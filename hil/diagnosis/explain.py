"""`explain`: measured logs in, an answer out. The library call behind ``brakebench explain``."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from dbc.database import parse_database
from hil.diagnosis.data.axle_torques import with_both_axles
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import Log
from hil.diagnosis.data.masks import is_straight_line
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import from_frame, read_logs
from hil.diagnosis.detection.result import Progress, Settings
from hil.diagnosis.detection.stepwise import diagnose
from hil.diagnosis.result.answer import Answer, answer
from hil.diagnosis.result.cross_validation import held_out_error
from hil.diagnosis.result.residual_patterns import residual_patterns
from hil.diagnosis.sensor_consistency.check import Consistency, check, why_not_simulatable
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.vehicle.extension_file import load_extension, write_extension
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.spec import Vehicle


def explain(
    logs: Any, vehicle: Path | str | Mapping[str, Any] | None = None, *, channel_map: Path | None = None,
    database: Path | None = None, about: Path | None = None, extend: Path | None = None, out: Path | None = None,
    settings: Settings | None = None, say: Progress | None = None,
) -> Answer | Consistency:  # fmt: skip
    """Explain what measured data have and the simulation has not.

    Where no force was measured, or none that pulls the car, the sensors are compared with the car's own motion
    (`hil.diagnosis.sensor_consistency`) instead of replaying it; the remarks say so.

    Parameters
    ----------
    logs : a data frame (or mapping of columns) in the canonical table, a path, or a list of either.
    vehicle : flat vehicle set as file or mapping; None is the shipped car.
    channel_map, database, about : another car's channels, its DBC, and ``logs.toml``.
    extend : extension file to begin with.
    out : folder for the extension file; none is written without.
    settings, say : what to switch off (for tests), and where to tell the progress.

    Raises
    ------
    hil.diagnosis.data.log.UnusableError
        Data or files that nothing can be concluded from: the message says why.
    """
    car = load_vehicle(shipped(Path(vehicle), "vehicle") if isinstance(vehicle, str | Path) else vehicle)
    read = with_both_axles(_logs(logs, car, channel_map, database, about))
    why = why_not_simulatable(read, float(car.parameters.wheel.rolling_radius_m))
    if why:
        return check(read, car, why, extend, out, say or (lambda _: None))
    car = car.without_lateral_dynamics() if is_straight_line(read) else car
    car = car.with_motor_limits_from(read)
    case = prepare(read, float(car.parameters.wheel.rolling_radius_m), car.unstated)
    handed_in = nominal(car)
    base = handed_in if extend is None else load_extension(Path(extend)).applied(handed_in)
    with threadpool_limits(1, "blas"):  # replays fill the processors; linear algebra beside them only waits
        found = diagnose(case, car, base, settings, say)
        (say or (lambda _: None))("measuring the gain on held-out manoeuvres")
        gained, missed = held_out_error(found), residual_patterns(found)
    written = None
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        written = str(Path(out) / "extension.toml")
        names = ", ".join(term.candidate.name for term in found.final.terms) or "no effect"
        fitter, final = found.fitter, found.final
        causes = fitter.parameter_set(np.zeros_like(final.z), final.terms).theta  # zeros of sensors are of these logs
        extended = replace(fitter.parameter_set(final.z, final.terms), theta=causes)
        write_extension(Path(written), handed_in, extended, f"Taught by {len(read)} logs: {names}")
    read_so = (f"{drive.log.name}: {text}" for drive in case.recordings for text in drive.log.remarks)
    remarks = [*car.remarks, *read_so, *found.remarks]
    return answer(found, gained, missed, written, remarks, None if out is None else Path(out))


def shipped(path: Path, kind: str) -> Path:
    """A file, or by the name of a car the one that comes with brakebench; ``kind`` is ``map`` or ``vehicle``."""
    ours = Path(str(resources.files("hil.diagnosis") / "cars" / f"{path.name}.{kind}.toml"))
    return ours if not path.suffix and not path.exists() and ours.exists() else path


def _logs(
    logs: Any, car: Vehicle, channel_map: Path | None, database: Path | None, about: Path | None
) -> Sequence[Log]:
    items = list(logs) if isinstance(logs, list | tuple) else [logs]
    mapped = None if channel_map is None else load_map(shipped(Path(channel_map), "map"))
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
            read.append(from_frame(item, f"dataframe {k}" if len(items) > 1 else "dataframe"))
    return read

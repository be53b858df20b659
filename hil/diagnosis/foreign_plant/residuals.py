"""`residuals`: the answer of ``brakebench explain --plant``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hil.diagnosis.data.channels_read import channels_read
from hil.diagnosis.data.dataset import ROW_S, Dataset, Recording
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.trial.run import on_trial
from hil.diagnosis.detection.result import Progress
from hil.diagnosis.explain import logs_of, refuse_another_car, vehicle_of
from hil.diagnosis.foreign_plant.compare import LEAST_SAMPLES, ChannelResidual, Pair, compare, paired
from hil.diagnosis.foreign_plant.replay import replay
from hil.diagnosis.vehicle.trial_car import car_of
from hil.fmu.plant_map import load_plant_map
from plant.vectors import INPUT

NOTHING_LEFT = 1.5
"""Times its noise within which a channel counts as reproduced: the noise of two sensors is 1.4 times that of one."""
_ACTS_NM, _DEMANDED_NM, _LEAST_UNDEMANDED_S = 20.0, 5.0, 0.2
"""Mean torque that drives or brakes, and demand that is none, N m; time that is remarked, s: longer than a lag."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """What an FMU gets wrong, and ``json`` as printed."""

    channels: tuple[ChannelResidual, ...]
    pairs: Mapping[str, Pair]
    dataset: Dataset
    json: dict[str, Any]


def residuals(
    logs: Any, plant: Path, plant_map: Path, vehicle: Path | None = None, *, channel_map: Path | None = None,
    database: Path | None = None, about: Path | None = None, progress: Progress | None = None,
) -> Residuals:  # fmt: skip
    """Replay somebody else's plant over measured inputs and compare it with what was measured.

    Parameters
    ----------
    plant, plant_map : the FMU, and what is what in it (`hil.fmu.plant_map`).
    logs, vehicle, channel_map, database, about : as of `hil.diagnosis.explain.explain`; of the vehicle the rolling
        radius and the torque constant serve, and the rest tells whether the logs can be right.

    Raises
    ------
    UnusableError : the logs permit no comparison.  hil.fmu.model.FmuError : the FMU fails.
    hil.scenario.table.ScenarioError : a wrong map.
    """
    report = progress or (lambda _: None)
    chart, car = load_plant_map(plant_map), vehicle_of(vehicle)
    radius_m = float(car.parameters.wheel.rolling_radius_m)
    read = logs_of(logs, car, channel_map, database, about, vehicle is not None)
    if vehicle is None:
        refuse_another_car(read)
    dataset = prepare(on_trial(read, car_of(car)), radius_m)
    constant_nm_a = float(car.parameters.motor.torque_constant_nm_a)
    found = replay(plant, chart, dataset, radius_m, constant_nm_a, report)
    pairs = paired(found.channels, dataset, radius_m)
    if not pairs:
        raise UnusableError(
            f"{plant.name}: no channel with {LEAST_SAMPLES} samples in which both the log and the FMU have a number "
            "while the car moves; give logs with longer manoeuvres, or correct the map"
        )
    channels = compare(pairs, dataset)
    content = {
        "headline": headline(plant.name, channels), "names_causes": False,
        "fmu": {"file": plant.name, **found.about},
        "logs": [one.log.name for one in dataset.recordings], "segments": len(dataset.segments),
        "channels": [one.as_json() for one in channels],
        "not_compared": sorted(set(found.channels) - set(pairs)),
        "channels_read": channels_read(one.log for one in dataset.recordings),
        "remarks": _remarks(found.about, dataset),
    }  # fmt: skip
    return Residuals(tuple(channels), pairs, dataset, content)


def headline(name: str, channels: Sequence[ChannelResidual]) -> str:
    """The channel farthest beyond its noise, and how many are; no cause."""
    first = channels[0]
    beyond = [one for one in channels if one.over_noise > NOTHING_LEFT]
    if not beyond:
        return f"{name} is within {NOTHING_LEFT:g} times the sensors' noise in all {len(channels)} channels."
    return (
        f"{name} misses {len(beyond)} of {len(channels)} channels by more than {NOTHING_LEFT:g} times their noise; "
        f"most {first.channel}, by {first.over_noise:.3g} times, worst {first.worst_context} "
        f"({first.worst_log}, {first.worst_s[0]:.1f} to {first.worst_s[1]:.1f} s). This names no cause."
    )


def _remarks(about: Mapping[str, Any], dataset: Dataset) -> list[str]:
    found = [
        f"{one.log.name}: motors act for {acts_s:.1f} s without a demand, which the FMU does not get"
        for one in dataset.recordings
        if (acts_s := _undemanded_s(one)) > _LEAST_UNDEMANDED_S
    ]
    found += [f"{one.log.name}: {text}" for one in dataset.recordings for text in one.log.remarks]
    if about["starts_at"] is None:
        found.insert(0, "the map has no start_speed: the FMU starts at its own speed, and each log is one stretch")
    return [*found, *dataset.missing_channels]


def _undemanded_s(recording: Recording) -> float:
    """Time for which motors act and nothing is demanded, as when a driver holds the speed, s."""
    torque, demand = (
        np.abs(recording.inputs[:, INPUT.slice(name)]).mean(axis=1) for name in ("motor_torque_nm", "motor_demand_nm")
    )
    return float(np.count_nonzero((torque > _ACTS_NM) & (demand < _DEMANDED_NM)) * ROW_S)

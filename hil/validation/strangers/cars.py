"""The strangers' cars by name, and a drive as files."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from hil.errors import BrakebenchError
from hil.validation.strangers.car import Hidden, StrangerCar
from hil.validation.strangers.dead_time import DeadTime

CARS: dict[str, StrangerCar] = {car.name: car for car in (DeadTime(),)}


def stated(car: StrangerCar, seed: int) -> dict[str, float | list[float]]:
    """The set that the owner writes for the drive of a seed."""
    return car.stated(np.random.default_rng([seed, 7]))


def write(car: StrangerCar, seed: int, hidden: Hidden | None, folder: Path) -> None:
    """Write the logs of a drive (``0.parquet`` and on) and the owner's ``vehicle.toml``; nothing tells what is hidden.

    Raises
    ------
    BrakebenchError
        There is something in the folder already.
    """
    if folder.exists() and any(folder.iterdir()):
        raise BrakebenchError(f"{folder}: not empty; give a folder that is empty or does not exist")
    folder.mkdir(parents=True, exist_ok=True)
    for k, table in enumerate(car.drive(seed, hidden)):
        pa.parquet.write_table(pa.table(dict(table)), folder / f"{k}.parquet")
    lines = [f"{key} = {json.dumps(value)}" for key, value in stated(car, seed).items()]
    (folder / "vehicle.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")

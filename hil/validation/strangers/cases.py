"""Drives of the trials: which car hides what, and how much; the logs and the set that are handed over."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from hil.errors import BrakebenchError, in_words
from hil.validation.strangers.brake_by_wire_van import BrakeByWireVan
from hil.validation.strangers.car import Cause, Hidden, StrangerCar
from hil.validation.strangers.dead_time import DeadTime
from hil.validation.strangers.hydraulic_saloon import HydraulicSaloon
from hil.validation.strangers.snr import Visibility

_CARS: tuple[StrangerCar, ...] = (DeadTime(), HydraulicSaloon(), BrakeByWireVan())
CARS = {car.name: car for car in _CARS}
FAMILIES = ("strangers", "strangers_single", "strangers_reference", "strangers_reference_single")
SNR, REACHED = 15.0, 0.02
"""Signal-to-noise ratio of what is hidden, and by which share it may be off."""


@dataclass(frozen=True)
class Case:
    """A drive of a car; ``hidden`` None is nothing. ``reached`` False: the cause's range ends before the ratio.

    ``reference`` is the seed of a day before with nothing hidden, None where there is none (`StrangerCar.drive`).
    """

    family: str
    index: int
    car: StrangerCar
    seed: int
    hidden: Hidden | None = None
    snr: float | None = None
    reached: bool = True
    reference: int | None = None

    @property
    def cause(self) -> Cause | None:
        """The hidden cause."""
        return None if self.hidden is None else self.car.causes[self.hidden.cause]


def draw(family: str, index: int, seed: int, cars: Sequence[StrangerCar] = tuple(CARS.values())) -> Case:
    """Case ``index`` of a family: cars in turn, each car's causes in turn; the same arguments give the same case.

    Raises
    ------
    BrakebenchError
        There is no such family.
    """
    if family not in FAMILIES:
        raise BrakebenchError(f"family {family!r}: expected one of {', '.join(FAMILIES)}")
    car, nth = cars[index % len(cars)], index // len(cars)
    rng = np.random.default_rng([seed, index, FAMILIES.index(family)])
    own = int(rng.integers(2**31))
    reference = int(rng.integers(2**31)) if "reference" in family else None
    if not family.endswith("single"):
        return Case(family, index, car, own, reference=reference)
    order = np.random.default_rng([seed, index % len(cars)]).permutation(len(car.causes))
    cause = car.causes[list(car.causes)[order[nth % len(order)]]]
    hidden, snr = Visibility(car, own, stated(car, own)).sized(cause, SNR)
    return Case(family, index, car, own, hidden, snr, abs(snr / SNR - 1.0) <= REACHED, reference)


def stated(car: StrangerCar, seed: int) -> dict[str, float | list[float]]:
    """The set that the owner writes for the drive of a seed."""
    return car.stated(np.random.default_rng([seed, 7]))


def write(car: StrangerCar, seed: int, hidden: Hidden | None, folder: Path, day: int | None = None) -> None:
    """Write the logs of a drive (``0.parquet`` and on) and the owner's ``vehicle.toml``; nothing tells what is hidden.

    ``day`` is the seed of another day with the same car.

    Raises
    ------
    BrakebenchError
        There is something in the folder already, or it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BrakebenchError(f"{folder}: not empty; give a folder that is empty or does not exist")
    lines = [f"{key} = {json.dumps(value)}" for key, value in stated(car, seed).items()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for k, table in enumerate(car.drive(seed, hidden, day=day)):
            pa.parquet.write_table(pa.table(dict(table)), folder / f"{k}.parquet")
        (folder / "vehicle.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise BrakebenchError(f"{folder}: cannot be written: {in_words(error)}") from error

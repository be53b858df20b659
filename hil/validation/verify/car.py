"""Runs of the paper's car for the verifications: inputs over time in, columns over time out."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from hil.scenario.parameters import load_set
from plant.integrate import SEMI_IMPLICIT
from plant.layout import Vector
from plant.model import Scene, initial_state, pack, replay
from plant.parameters import PlantParameters
from plant.road import DRY, RoadSegment, road_table
from plant.vectors import CUT, INPUT

ROW_S = 0.01
WHEELS = ("fl", "fr", "rl", "rr")


@cache
def paper_car() -> PlantParameters:
    """The shipped parameter set."""
    return load_set(resources.files("plant").joinpath("parameters/paper_car.toml"), PlantParameters)


def inputs(duration_s: float, parts: Mapping[str, Callable[[Vector], Vector | float] | float]) -> Vector:
    """Input table of one row each `ROW_S`: parts of ``INPUT`` as constants or functions of the time.

    A function of n times gives n values for all elements of its part, or (n, elements).
    """
    time_s = np.arange(round(duration_s / ROW_S), dtype=np.float64) * ROW_S
    table = np.zeros((len(time_s), INPUT.size))
    for part, value in parts.items():
        values = np.asarray(value(time_s) if callable(value) else value, dtype=np.float64)
        table[:, INPUT.slice(part)] = values[:, None] if values.ndim == 1 else values
    return table


class Run:
    """Columns of one run by name; ``four`` gives the wheels of a part, shape (rows, 4)."""

    def __init__(self, names: list[str], table: Vector) -> None:
        self._columns = {name: table[:, k] for k, name in enumerate(names)}
        self.time_s: Vector = np.arange(len(table), dtype=np.float64) * ROW_S

    def __getitem__(self, name: str) -> Vector:
        return self._columns[name]

    def four(self, part: str) -> Vector:
        """The four wheels of a part."""
        return np.column_stack([self._columns[f"{part}_{wheel}"] for wheel in WHEELS])


def drive(
    table: Vector,
    speed_mps: float,
    columns: list[str],
    parameters: PlantParameters | None = None,
    *,
    road: tuple[RoadSegment, ...] = DRY,
    disc_temperature_k: float = 423.15,
    state_of_charge: float = 0.7,
    step_s: float = 1e-3,
    method: int = SEMI_IMPLICIT,
    cut: NDArray[np.float64] | None = None,
) -> Run:
    """Drive the car through a table of inputs; a column ``part_*`` stands for its four wheels."""
    car = paper_car() if parameters is None else parameters
    names = [n.replace("*", w) for n in columns for w in (WHEELS if n.endswith("*") else ("",))]
    start = initial_state(car, speed_mps, disc_temperature_k, state_of_charge)
    steps = round(ROW_S / step_s)
    scene = Scene(cut=CUT.zeros() if cut is None else cut, road=road_table(road))
    result = replay(start, table, pack(car), names, scene, step_s=step_s, steps=steps, method=method)
    return Run(names, result[0])


def changed(part: str, **values: float | tuple[float, ...]) -> PlantParameters:
    """The paper's car with some values of one part changed."""
    car = paper_car()
    return replace(car, **{part: replace(getattr(car, part), **values)})

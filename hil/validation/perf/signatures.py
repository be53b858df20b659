"""What the rivals of `explain` are given: the residual of the nominal car and one signature an effect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.estimation.information import finite_difference_jacobian
from hil.diagnosis.estimation.terms import Column, candidates, columns
from hil.diagnosis.noise.estimate import first_guess
from hil.diagnosis.noise.model import SampleMasks, tracks_of
from hil.diagnosis.simulation.parameter_set import nominal
from hil.diagnosis.simulation.simulator import Simulator
from hil.diagnosis.vehicle.load import load_vehicle

_LEAST_REACH = 1e-3
"""Norm, in standard deviations of the noise, that the largest allowed value must make: below, nothing is to be seen."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Residual and signatures of one set of logs, all channels in a row, each over its white noise.

    Attributes
    ----------
    residual : (rows,), measured less simulated, in standard deviations.
    signatures : (rows, columns), what the largest allowed value of a column's number would add to it.
    effects : name of each column's effect.
    places : an effect's name and the columns that move together there; what is not to be seen is left out.
    samples : how many samples were compared; the rows may be a triangular factor that stands for them.
    """

    residual: Floats
    signatures: Floats
    effects: tuple[str, ...]
    places: tuple[tuple[str, tuple[int, ...]], ...]
    samples: int


def problem(logs: Sequence[Path], vehicle: Path) -> Problem:
    """Of logs, or folders of them: no number of the vehicle is fitted and no disturbance is modelled.

    Inputs are rid of noise, tracks masked and sensitivities taken as `hil.diagnosis.detection.stepwise` does.
    """
    car = load_vehicle(vehicle)
    base = nominal(car)
    radius_m = float(car.parameters.wheel.rolling_radius_m)
    torque_constant = float(car.parameters.motor.torque_constant_nm_a)
    rig = (
        Simulator(prepare(read_logs(logs, None, None, None, torque_constant), radius_m), car)
        .prepared(base)
        .with_baseline(base)
    )
    frame = SampleMasks.of(rig.dataset)
    simulated = rig.run(base)
    apart = {group: values - simulated[group] for group, values in rig.measured().items()}
    residual = tracks_of(apart, frame, radius_m)
    of = columns(car.undiagnosable_effects)
    worlds = [column.stepped(base) for column in of]
    signatures = finite_difference_jacobian(rig, frame, simulated, worlds, [column.step for column in of])
    noise = first_guess(residual, frame, enabled=False)
    weights = {name: known / noise.tracks[name].a for name, known in frame.present.items()}
    rows = triangle(residual, signatures, weights)
    samples = int(sum(float(known.sum()) for known in frame.present.values()))
    return _visible(rows[:, 0], rows[:, 1:], of, samples)


def triangle(residual: Mapping[str, Floats], signatures: Mapping[str, Floats], weights: Mapping[str, Floats]) -> Floats:
    """Triangular factor of [residual, signatures] of all tracks, (1 + columns, 1 + columns).

    Its columns have the same products with each other as the weighted samples', so that every least-squares problem
    has the same answer (Golub and Van Loan 2013, Matrix Computations, sec. 5.3); tracks are taken in one by one.
    """
    found: Floats | None = None
    for name, values in residual.items():
        block = np.column_stack((values[:, 0], signatures[name])) * weights[name][:, None]
        found = np.asarray(np.linalg.qr(block if found is None else np.vstack((found, block)), mode="r"))
    assert found is not None  # `prepare` refuses logs without anything to compare
    return found


def _visible(residual: Floats, per_unit: Floats, of: Sequence[Column], samples: int) -> Problem:
    """Without columns that do not show."""
    largest = np.array([max(abs(column.parameter.low), abs(column.parameter.high)) for column in of])
    signatures = per_unit * largest
    shown = np.linalg.norm(signatures, axis=0) > _LEAST_REACH
    at = {int(k): n for n, k in enumerate(np.flatnonzero(shown))}
    places = [(c.effect.name, tuple(at[k] for k in c.columns if k in at)) for c in candidates(list(of))]
    effects = tuple(column.effect.name for column, seen in zip(of, shown, strict=True) if seen)
    unique = tuple(dict.fromkeys(place for place in places if place[1]))
    return Problem(residual, signatures[:, shown], effects, unique, samples)

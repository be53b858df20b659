"""Numbers that the fit moved: each nuisance parameter as stated and as estimated, with its interval."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.detection.result import Diagnosis
from hil.diagnosis.estimation.information import information_blocks
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.vehicle.key_names import Quantity, quantity, stated_key
from hil.diagnosis.vehicle.priors import HALF_WIDTH_TO_SIGMA, Nuisance, NuisanceKind

MOST_SHOWN = 12
"""Rows of the table for people, at most."""
_SHOWN_DEVIATIONS, _TOLERANCE_DEVIATIONS = 1.0, 1.0 / HALF_WIDTH_TO_SIGMA
_SHOWN_CORRELATION = 0.5
"""Correlation with a cause's value from which on a number matters to it."""
_TWO_SIDED_95 = 1.96
_AT_BOUND = 1e-3
BESIDE_REFERENCE = (
    NuisanceKind.LEARNED, NuisanceKind.LEARNED_CURVE, NuisanceKind.OF_THE_DAY,
    NuisanceKind.DISC_TEMPERATURE_OF_THE_DAY,
)  # fmt: skip
"""Nuisance parameters that reference logs bring, and no vehicle set has a key for."""

Value = float | list[float]
"""One number, or one for each axle."""


@dataclass(frozen=True)
class MovedNumber:
    """One nuisance parameter, in ``quantity.unit``.

    Attributes
    ----------
    key : as the set writes it, else the one to write; empty where no set states it.  stated : the set states it.
    nominal, half_width : value before the fit, and the tolerance about it.  estimate, low, high : with 95 % interval.
    deviations : prior standard deviations that it moved; a tolerance is two.
    correlation : largest with the value of a cause, by size; None without causes.
    at_bound : it may not move farther.
    """

    key: str
    quantity: Quantity
    stated: bool
    nominal: Value
    half_width: float
    estimate: Value
    low: Value
    high: Value
    deviations: float
    correlation: float | None
    at_bound: bool

    @property
    def words(self) -> str:
        """What it is, and where."""
        return ", ".join(filter(None, (self.quantity.what, self.quantity.location)))

    @property
    def beyond_tolerance(self) -> bool:
        """It is stated, and left its tolerance."""
        return self.stated and abs(self.deviations) > _TOLERANCE_DEVIATIONS

    @property
    def moved_unstated(self) -> bool:
        """It is a number of the car that the set does not state, and moved."""
        return not self.stated and self.quantity.has_value and abs(self.deviations) > _SHOWN_DEVIATIONS

    @property
    def shown(self) -> bool:
        """It moved, or a cause's value depends on it."""
        return abs(self.deviations) > _SHOWN_DEVIATIONS or abs(self.correlation or 0.0) > _SHOWN_CORRELATION

    def as_json(self) -> dict[str, Any]:
        """Entry of ``moved_numbers``."""
        return {
            "key": self.key or None, "what": self.quantity.what, "location": self.quantity.location or "car",
            "unit": self.quantity.unit, "stated": self.stated, "nominal": self.nominal, "half_width": self.half_width,
            "estimate": self.estimate, "ci95": [self.low, self.high], "deviations": self.deviations,
            "correlation_with_cause": self.correlation, "at_bound": self.at_bound,
        }  # fmt: skip


def moved_numbers(diagnosis: Diagnosis) -> list[MovedNumber]:
    """Every number of the car and the logs in the final model, those that moved farthest first."""
    fitter, vehicle, model = diagnosis.fitter, diagnosis.vehicle, diagnosis.final
    deviations, correlations = uncertainty(diagnosis)
    listed = []
    for k, nuisance in enumerate(fitter.nuisances):
        if nuisance.kind in BESIDE_REFERENCE:
            continue
        z, base = float(model.z[k]), fitter.base
        what = quantity(nuisance, vehicle)
        key = stated_key(nuisance, what, vehicle.stated)
        bounds = np.clip((z - deviations[k], z, z + deviations[k]), nuisance.lower, nuisance.upper)
        at_zero, *moved = (_value(nuisance, what, base, float(at)) for at in (0.0, *bounds))
        low, estimate, high = moved
        listed.append(
            MovedNumber(
                key or what.key, what, bool(key), at_zero, _half_width(nuisance, what, base), estimate, low, high, z,
                None if correlations is None else float(correlations[k]),
                abs(z) > _AT_BOUND and not nuisance.lower + _AT_BOUND < z < nuisance.upper - _AT_BOUND,
            )
        )  # fmt: skip
    return sorted(listed, key=lambda one: -abs(one.deviations))


def shown_numbers(listed: Sequence[MovedNumber]) -> tuple[list[MovedNumber], int]:
    """Those for people, at most `MOST_SHOWN`, and how many others there are."""
    shown = [one for one in listed if one.shown][:MOST_SHOWN]
    return shown, len(listed) - len(shown)


def uncertainty(diagnosis: Diagnosis) -> tuple[Floats, Floats | None]:
    """Half of the 95 % interval of each nuisance in prior standard deviations, the causes marginalised; its correlation
    with the cause it goes with most."""
    fitter, model, noise = diagnosis.fitter, diagnosis.final, diagnosis.noise
    count, precision = len(fitter.nuisances), np.ones(len(fitter.nuisances))
    information = fitter.nuisance_information(noise)
    if model.terms:
        own, columns = fitter.term_jacobian(model), fitter.nuisance_jacobian_at(model)
        joined = {name: np.hstack([values, own[name]]) for name, values in columns.items()}
        total = information_blocks(model.residual, joined, fitter.masks, noise, count).total()
        information = total[1:, 1:]
        precision = np.append(precision, [term.candidate.prior_sd**-2.0 for term in model.terms])
    matrix = information + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(matrix))  # units of the causes differ by ten decades
    covariance = scale[:, None] * np.linalg.inv(scale[:, None] * matrix * scale) * scale
    sd = np.sqrt(np.diag(covariance))
    if not model.terms:
        return _TWO_SIDED_95 * sd, None
    correlation = covariance[:count, count:] / np.outer(sd[:count], sd[count:])
    most = np.argmax(np.abs(correlation), axis=1)
    return _TWO_SIDED_95 * sd[:count], correlation[np.arange(count), most]


def _value(nuisance: Nuisance, what: Quantity, base: ParameterSet, z: float) -> Value:
    """The quantity with a nuisance ``z`` standard deviations off."""
    values = _read(nuisance, base.with_nuisances((nuisance,), np.array([z])))
    shown = [what.shown(value) for value in values]
    first, *others = (
        shown[:1] if nuisance.step[0] != nuisance.step[-1] else shown
    )  # moved against each other: the first
    return first if all(np.isclose(first, other, rtol=1e-9, atol=0.0) for other in others) else [first, *others]


def _half_width(nuisance: Nuisance, what: Quantity, base: ParameterSet) -> float:
    """Tolerance of the quantity: two standard deviations, added."""
    value, step = _read(nuisance, base)[0], abs(nuisance.step[0]) / HALF_WIDTH_TO_SIGMA
    return abs(what.shown(value + step) - what.shown(value))


def _read(nuisance: Nuisance, parameters: ParameterSet) -> list[float]:
    values: Sequence[float] | Floats
    match nuisance.kind:
        case NuisanceKind.VEHICLE | NuisanceKind.SIGNED:
            values = parameters.p[list(nuisance.at)]
        case NuisanceKind.DISC_TEMPERATURE:
            values = [parameters.disc_offset_k]
        case NuisanceKind.TOOTH_LAG:
            values = [parameters.tooth_share]
        case NuisanceKind.TOOTH_WINDOW:
            values = [parameters.window_rows2]
        case NuisanceKind.SENSOR | NuisanceKind.SIDE_TO_SIDE | NuisanceKind.LINE_LAG:
            values = parameters.theta[list(nuisance.at)]
        case _:
            values = [parameters.latency_s[at] for at in nuisance.at]
    return [float(value) for value in values]

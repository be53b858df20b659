"""The model's own error, measured: how much more each number of an effect seems to explain where nothing is hidden.

Two models of one car, written apart, differ in form; some effects imitate such differences. ``model_discrepancy.toml`` holds
the root mean square of each number's estimate over its standard deviation, on drives of a car that shares no code with
the plant and has nothing hidden (``brakebench trials --own-error``); 1 would be a perfect model. Whole car, axle, side
and wheel have each their own: what the form does to all wheels alike it does not do to one. A gain in chi-squared is
divided by its square before it is called beyond noise. The same is measured for the laws in no list, of all their
coefficients together. It holds more of what errs more where a set says nothing of the car's springs (``unsprung``).
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources

from hil.diagnosis.estimation.terms import Candidate, location_kind

UNMEASURED_RATIO = 1.2
"""Where nothing was measured."""
UNSURE, FEW = 2.0, 1.4
"""Beyond this ratio an estimate is off by the model more than by noise, and by how much is known from thirty drives:
the quantile asked for is Student's of thirty degrees of freedom, whose square is so much larger than the normal one's
at 1.25e-5."""
UNLISTED = "unlisted"
"""Name of all laws in no list."""


Table = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Ratios by effect, number and kind of place."""


@cache
def _tables() -> Mapping[str, Table]:
    source = resources.files("hil.diagnosis.estimation") / "model_discrepancy.toml"
    tables: Mapping[str, Table] = tomllib.loads(source.read_text(encoding="utf-8"))
    return tables


def variance_inflation(candidate: Candidate) -> float:
    """What the gain of a candidate is divided by, at least 1."""
    return _variance(candidate.effect.name, candidate.parameter.name, candidate.location, candidate.suspension_stated)


def variance_inflation_nonparametric(name: str, place: str) -> float:
    """The same for a law in no list, by `hil.diagnosis.detection.nonparametric.NonparametricTerm.name`, whatever is known of the springs."""
    return _variance(UNLISTED, name, place, sprung=False)


def _variance(effect: str, number: str, place: str, sprung: bool) -> float:
    kind = location_kind(place)
    ratio = _ratio("ratio", effect, number, kind, UNMEASURED_RATIO)
    if not sprung:
        ratio = max(ratio, _ratio("unsprung", effect, number, kind, 1.0))
    return with_uncertainty(max(ratio, 1.0) ** 2)


def _ratio(table: str, effect: str, number: str, kind: str, otherwise: float) -> float:
    return _tables().get(table, {}).get(effect, {}).get(number, {}).get(kind, otherwise)


def with_uncertainty(variance: float) -> float:
    """What a gain is divided by where the model errs by ``variance``, in variances of noise: more if it is large, for
    it is known from few drives or numbers."""
    return variance * (FEW if variance > UNSURE**2 else 1.0)

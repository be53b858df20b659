"""Model discrepancy: how much more of a candidate the plant's own form error explains than noise does.

Takes a candidate; gives the variance its gain in chi-squared is divided by. Independent vehicle models differ in
form, and some effects imitate such differences. ``model_discrepancy.toml`` holds the root mean square of estimate over
standard deviation of each effect parameter, by kind of location (car, axle, side, wheel), on drives of the reference
car with nothing hidden (``brakebench trials --own-error``); 1 is a perfect model. Nonparametric terms are measured
the same way, over all their coefficients. ``unsprung`` holds larger ratios where a vehicle set states no suspension.
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources

from hil.diagnosis.estimation.terms import Candidate, location_kind

UNMEASURED_RATIO = 1.2
"""Ratio where nothing was measured: a little above the median of those that were (1.08)."""
UNSURE, FEW = 2.0, 1.4
"""Ratio from which the model errs more than the noise, and the factor on its variance there.

A ratio is known from some thirty drives, so the quantile of the threshold is that of Student's distribution with
thirty degrees of freedom; its square is 1.4 times that of the normal one at a probability of 1.25e-5."""
FORM_SHARE = 0.06
"""Standard deviation of an effect that a car of other equations seems to have, in sizes typical of real cars, where the
set does not state every limit (docs/decisions/detection-threshold.md)."""
UNLISTED = "unlisted"
"""Name of all nonparametric terms in the tables."""
Table = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Ratios by effect, parameter and kind of location."""


@cache
def _tables() -> Mapping[str, Table]:
    source = resources.files("hil.diagnosis.estimation") / "model_discrepancy.toml"
    tables: Mapping[str, Table] = tomllib.loads(source.read_text(encoding="utf-8"))
    return tables


def variance_inflation(candidate: Candidate) -> float:
    """Variance inflation of a candidate's gain in chi-squared, at least 1."""
    return _variance(candidate.effect.name, candidate.parameter.name, candidate.location, candidate.suspension_stated)


def corrected_gain(candidate: Candidate, raw: float, value: float, lasting: bool = True) -> float:
    """Gain in chi-squared of a candidate's ``value`` with the model discrepancy as further variance.

    The variance of the value is that by noise, times `variance_inflation`, and that of the model's form, ``form_sd``:
    1 / gain = inflation / raw + (form_sd / value)^2. So a value that the data determine however well gains no more than
    its distance from zero in ``form_sd`` (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425: a discrepancy does not
    shrink with the number of samples). A cause that is not ``lasting`` begins within the logs: no form error does.
    """
    form = candidate.form_sd / value if lasting and value else 0.0
    return raw / (variance_inflation(candidate) + max(raw, 0.0) * form**2)


def variance_inflation_nonparametric(name: str, location: str) -> float:
    """The same for a nonparametric term by its name, whatever is stated of the suspension."""
    return _variance(UNLISTED, name, location, suspension_stated=False)


def _variance(effect: str, parameter: str, location: str, suspension_stated: bool) -> float:
    kind = location_kind(location)
    ratio = _ratio("ratio", effect, parameter, kind, UNMEASURED_RATIO)
    if not suspension_stated:
        ratio = max(ratio, _ratio("unsprung", effect, parameter, kind, 1.0))
    return with_uncertainty(max(ratio, 1.0) ** 2)


def _ratio(table: str, effect: str, parameter: str, kind: str, default: float) -> float:
    return _tables().get(table, {}).get(effect, {}).get(parameter, {}).get(kind, default)


def with_uncertainty(variance: float) -> float:
    """Variance inflation with its own uncertainty: a large ratio comes from few drives or parameters."""
    return variance * (FEW if variance > UNSURE**2 else 1.0)

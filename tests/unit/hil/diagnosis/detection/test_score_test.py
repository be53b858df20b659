"""Score tests: estimates, bounds, inflation and model discrepancy."""

import tomllib
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from hil.diagnosis.detection.nonparametric import NONPARAMETRIC_TERMS
from hil.diagnosis.detection.score_test import (
    inflation_factor,
    score,
    scores,
    scores_given_best,
    shortlist,
)
from hil.diagnosis.estimation.information import InformationBlocks, marginalise, solve
from hil.diagnosis.estimation.model_discrepancy import UNLISTED, corrected_gain, variance_inflation
from hil.diagnosis.estimation.terms import LOCATIONS, candidates, columns, location_kind, log_prior
from hil.diagnosis.estimation.uncertainty import half_width

CANDIDATES = {c.name: c for c in candidates(columns())}


def test_a_score_test_estimates_the_value_that_made_the_residual() -> None:
    candidate = CANDIDATES["mass_offset@car"]
    q, true = 1.0, 120.0
    test = score(candidate, q * true, q)
    assert test.value == pytest.approx(true, rel=1e-3)
    assert test.raw_gain == pytest.approx(q * true**2, rel=1e-3)


def test_a_value_of_the_forbidden_sign_explains_nothing() -> None:
    test = score(CANDIDATES["residual_drag@fl"], -50.0, 10.0)
    assert test.value == 0.0
    assert test.gain == 0.0


def test_a_prior_makes_a_large_value_unlikely_and_not_impossible() -> None:
    """Pads that bind: 20 times what is usual, and data that want no other cause by 60 in chi-squared."""
    usual = np.linspace(0.0, 2.0, 9)
    assert [log_prior(value, 1.0) for value in usual] == pytest.approx(-0.5 * usual**2, abs=0.3)
    assert log_prior(-3.0, 2.0) == log_prior(3.0, 2.0)
    typical, bound = 1.0 / CANDIDATES["residual_drag@rl"].prior_sd, 20.0
    assert -30.0 < log_prior(bound * CANDIDATES["residual_drag@rl"].parameter.typical * typical, 1.0) < -5.0


def test_what_leaves_no_trace_cannot_score() -> None:
    assert score(CANDIDATES["mass_offset@car"], 1.0, 0.0).max_snr == 0.0


def test_model_discrepancy_raises_the_inflation() -> None:
    quiet = [score(c, 0.3, 1e4) for c in CANDIDATES.values()]
    loud = [score(c, 0.05 * c.parameter.typical * 1e6, 1e6) for c in CANDIDATES.values()]
    assert inflation_factor(quiet) == 1.0
    assert inflation_factor([]) == 1.0
    assert inflation_factor(loud) > 1.0


def test_a_cause_that_shows_through_others_is_no_inflation() -> None:
    """Signatures that all resemble one: the cause inflates what every one gains, and nothing given it.

    Noise along what they share is explained by all of them at once, so one draw says little: the median of eleven does.
    """
    listed = [c for c in CANDIDATES.values() if len(c.columns) == 1 and c.parameter.low < 0.0]
    count = 1 + max(c.columns[0] for c in listed)
    tau = np.ones(count)
    for candidate in listed:
        tau[candidate.columns[0]] = candidate.prior_sd
    cause, inflations = listed[0], []
    for seed in range(11):
        rng = np.random.default_rng(seed)
        shared = rng.standard_normal(3000)
        signatures = (0.8 * shared[:, None] + 0.6 * rng.standard_normal((3000, count))) / tau
        hidden = 0.3 * cause.prior_sd * signatures[:, cause.columns[0]]
        joined = np.column_stack((rng.standard_normal(3000) + hidden, signatures))
        total = InformationBlocks((joined.T @ joined)[None], 0, 3000, 0.0)
        tests = scores(listed, marginalise(total.total(), 0), 0, [0.0] * len(listed))
        assert inflation_factor(tests) > 3.0
        inflations.append(inflation_factor(scores_given_best(tests, total, np.zeros(0), ())))
    assert np.median(inflations) == pytest.approx(1.0, abs=0.3)


def test_a_gain_is_divided_by_the_model_discrepancy() -> None:
    candidate = CANDIDATES["tyre_relaxation@car"]
    test = score(candidate, 0.1 * 1e4, 1e4)
    assert variance_inflation(candidate) > 1.0
    assert test.gain == pytest.approx(test.raw_gain / variance_inflation(candidate))


def test_what_the_form_may_imitate_gains_little_however_well_it_is_determined() -> None:
    """Pads 0.3 % per 10 m/s, at 20 standard deviations, are a tenth of a typical cause: form, unless it begins."""
    plain = CANDIDATES["mu_speed.slope_s_m@car"]
    candidate = replace(plain, form_sd=0.06 * abs(plain.parameter.typical))
    value = 0.08 * plain.parameter.typical
    assert corrected_gain(plain, 400.0, value) > 200.0
    assert corrected_gain(candidate, 400.0, value) < (0.08 / 0.06) ** 2
    assert corrected_gain(candidate, 400.0, value, lasting=False) == corrected_gain(plain, 400.0, value)
    assert corrected_gain(candidate, 400.0, plain.parameter.typical) > 100.0
    assert half_width(candidate, 0.0, 0.0) == pytest.approx(1.96 * candidate.form_sd)


def test_candidates_of_a_set_with_every_limit_have_no_form_error() -> None:
    assert all(one.form_sd == 0.0 for one in candidates(columns()))
    for one in candidates(columns(), form_share=0.1):
        assert one.form_sd == pytest.approx(one.prior_sd / 15.0)


def test_dive_has_more_discrepancy_where_the_springs_are_not_stated() -> None:
    candidate = CANDIDATES["pitch_dive@car"]
    assert variance_inflation(replace(candidate, suspension_stated=False)) > variance_inflation(candidate)
    assert variance_inflation(candidate) == variance_inflation(replace(candidate, suspension_stated=True))


def test_every_entry_of_the_discrepancy_table_is_a_parameter_or_nonparametric_term_at_a_kind_of_location() -> None:
    kinds = {(c.effect.name, c.parameter.name, location_kind(c.location)) for c in CANDIDATES.values()}
    kinds |= {(UNLISTED, one.name, location_kind(at)) for one in NONPARAMETRIC_TERMS for at in LOCATIONS[one.scope]}
    source = resources.files("hil.diagnosis.estimation") / "model_discrepancy.toml"
    tables = tomllib.loads(source.read_text(encoding="utf-8"))
    entries = [
        ((effect, name, kind), ratio)
        for effect, parameters in (*tables["ratio"].items(), *tables["unsprung"].items())
        for name, ratios in parameters.items()
        for kind, ratio in ratios.items()
    ]
    assert {entry for entry, _ in entries} <= kinds
    assert all(ratio >= 1.0 for _, ratio in entries)


def test_both_the_best_explanation_and_the_clearest_are_fitted() -> None:
    """A parameter with much discrepancy explains most; one with little is still shortlisted."""
    erring = [s for s in (score(c, 40.0, 100.0) for c in CANDIDATES.values()) if variance_inflation(s.candidate) > 4.0]
    clear = min(CANDIDATES.values(), key=variance_inflation)
    listed = [*erring, score(clear, 30.0 / abs(clear.parameter.typical), 100.0 / clear.parameter.typical**2)]
    assert clear in [s.candidate for s in shortlist(listed, 2)]


def test_a_nuisance_takes_only_what_its_tolerance_allows() -> None:
    """Column equal to the nuisance's: the share beyond the tolerance is left to the effect."""
    n, size = 1.0e4, 5.0  # five standard deviations off
    total = np.array([[n * size**2, n * size, n * size], [n * size, n, n], [n * size, n, n]])
    left = marginalise(total, 1, (), np.zeros(1))
    assert left.b[0] ** 2 / left.q[0, 0] == pytest.approx(size**2, rel=1e-3)


def test_solve_gives_back_what_was_put_in() -> None:
    rng = np.random.default_rng(3)
    columns_, true = rng.standard_normal((500, 3)), np.array([0.5, -0.2, 2.0])
    joined = np.column_stack((columns_ @ true, columns_))
    change, _ = solve(joined.T @ joined * 1e4, 2, [0], np.zeros(2))
    assert change == pytest.approx(true, rel=1e-3)

"""Intervals and what is said of them."""

from dataclasses import replace

import numpy as np
import pytest

from hil.identify.coverage import TRUTHS, with_noise
from hil.identify.fit import fit
from hil.identify.uncertainty import (
    correlations,
    disagreements,
    estimates,
    findings,
    joint_limit,
    joint_statistic,
    log_covariance,
    shown_directly,
)


def test_covariance_of_the_parameters_is_that_of_the_coordinates_turned(fitted):
    fitted = fitted["friction"]
    rng = np.random.default_rng(1)
    small = replace(fitted, covariance=1e-4 * fitted.covariance)  # close enough to be linear
    drawn = rng.multivariate_normal(small.coordinates, small.covariance, 4000)
    logs = np.log([small.scale.pad(x) for x in drawn])
    spread = np.sqrt(np.diag(log_covariance(small)))
    assert logs.std(axis=0) == pytest.approx(spread, rel=0.05)
    assert np.corrcoef(logs.T) == pytest.approx(correlations(small), abs=0.05)


def test_intervals_hold_the_value_and_the_meaning_of_the_direct_ones(fitted):
    fitted = fitted["friction"]
    for n in (*estimates(fitted), *shown_directly(fitted)):
        assert 0.0 < n.low < n.value < n.high
    pad, power = fitted.pad, fitted.scale.power_w
    at_rest, settling, heating = (n.value for n in shown_directly(fitted))
    assert at_rest == pytest.approx(pad.a / pad.b * fitted.scale.temperature_k / (power + pad.eps))
    assert settling == pytest.approx(pad.b * (power + pad.eps))
    assert heating == pytest.approx(pad.c * pad.gamma * power)


def test_what_is_tied_is_said(fitted):
    fitted = fitted["friction"]
    said = " ".join(findings(fitted))
    assert "eps and b are hardly told apart: correlation -0.9" in said
    assert "poorly" not in said


def test_a_short_record_tells_little_and_says_so(clean, brake):
    record = with_noise(clean["friction"], "first-order", 2)
    names = ("time_s", "pressure_pa", "speed_mps", "torque_nm", "temperature_k")
    cut = replace(record, **{name: getattr(record, name)[:450] for name in names})
    short = fit(cut, brake, "friction")
    poor = {n.symbol for n in estimates(short) if n.told == "poorly"}
    assert "c" in poor
    assert any(line.startswith("c is poorly determined") for line in findings(short))
    assert all(np.isfinite([n.low, n.high]).all() for n in estimates(short))


def test_joint_region(fitted):
    fitted = fitted["friction"]
    assert joint_statistic(fitted, fitted.pad) == pytest.approx(0.0, abs=1e-12)
    assert joint_limit(fitted, 0.99) == pytest.approx(15.1, abs=0.1)  # chi-squared, five degrees of freedom
    assert joint_limit(fitted, 0.95) == pytest.approx(11.1, abs=0.1)


def test_records_of_one_truth_agree_and_of_two_do_not(fitted, clean, brake):
    fitted = fitted["friction"]
    again = fit(with_noise(clean["friction"], "white", 9), brake, "friction")
    assert disagreements(fitted, again) == ()
    c = TRUTHS["friction"].c
    moved = replace(fitted, pad=fitted.pad._replace(c=1.5 * c))
    assert [line.split()[0] for line in disagreements(fitted, moved)] == ["c"]

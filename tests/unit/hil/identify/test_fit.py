"""The fit on records of known truth."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.errors import BrakebenchError
from hil.identify.coverage import TRUTHS, with_noise
from hil.identify.fit import Scale, fit
from hil.identify.model import HEATINGS, Pad, Start
from hil.identify.uncertainty import estimates, joint_limit, joint_statistic

positive = st.floats(1e-6, 1e6)


@given(st.tuples(*[positive] * 5), st.tuples(positive, positive))
def test_coordinates_lead_back_to_the_parameters(pad, start):
    scale = Scale(12e3, 400.0)
    assert scale.pad(scale.coordinates(Pad(*pad), Start(*start))) == pytest.approx(pad, rel=1e-9)


@pytest.mark.parametrize("heating", HEATINGS)
def test_truth_lies_in_the_joint_region_and_residuals_are_the_noise(fitted, heating):
    fitted = fitted[heating]
    assert joint_statistic(fitted, TRUTHS[heating]) < joint_limit(fitted, 0.99)
    assert fitted.torque_noise.rms == pytest.approx(2.05, rel=0.06)
    assert fitted.temperature_noise.rms == pytest.approx(0.4, rel=0.06)
    assert fitted.torque_noise.white
    assert fitted.valleys == 3
    assert fitted.at_edge == ()
    assert all(n.half_width < 0.15 * n.value for n in estimates(fitted))


@pytest.mark.parametrize("heating", HEATINGS)
def test_a_truth_elsewhere_lies_outside(fitted, heating):
    fitted = fitted[heating]
    truth = TRUTHS[heating]
    for name, factor in (("a", 1.02), ("b", 1.2), ("c", 1.05), ("gamma", 1.02), ("eps", 1.3)):
        wrong = truth._replace(**{name: factor * getattr(truth, name)})
        assert joint_statistic(fitted, wrong) > joint_limit(fitted, 0.99), name


@pytest.mark.parametrize("heating", HEATINGS)
def test_the_true_heating_form_is_likelier(noisy, brake, fitted, heating):
    other = "friction" if heating == "printed" else "printed"
    assert fitted[heating].log_likelihood > fit(noisy[heating], brake, other).log_likelihood + 100.0


def test_coloured_noise_widens_the_intervals(clean, brake, fitted):
    white, coloured = fitted["printed"], fit(with_noise(clean["printed"], "first-order", 5), brake, "printed")
    assert coloured.torque_noise.memory == pytest.approx(0.9, abs=0.04)
    assert not coloured.torque_noise.white
    ratio = estimates(coloured)[0].half_width / estimates(white)[0].half_width
    assert 2.0 < ratio < 6.0  # sqrt(19) for what is slow beside the noise


def test_the_same_record_gives_the_same_bits(noisy, brake, fitted):
    first, second = fitted["printed"], fit(noisy["printed"], brake, "printed")
    assert first.pad == second.pad
    assert np.array_equal(first.covariance, second.covariance)


def test_uneven_sampling_is_no_trouble(clean, brake):
    record = with_noise(clean["printed"], "white", 8)
    kept = np.sort(np.random.default_rng(1).permutation(record.time_s.size)[: record.time_s.size // 2])
    kept[0] = 0
    names = ("time_s", "pressure_pa", "speed_mps", "torque_nm", "temperature_k")
    thinned = replace(record, **{name: getattr(record, name)[kept] for name in names})
    fitted = fit(thinned, brake, "printed")
    assert joint_statistic(fitted, TRUTHS["printed"]) < joint_limit(fitted, 0.99)


def test_refuses_a_brake_that_never_touches(noisy, brake):
    with pytest.raises(BrakebenchError, match="never passes the threshold of 40 bar"):
        fit(noisy["printed"], replace(brake, threshold_pressure_pa=40e5), "printed")


def test_a_temperature_that_stands_still_leaves_its_rate_open(noisy, brake):
    record = replace(noisy["printed"], temperature_k=np.full(noisy["printed"].time_s.size, 400.0))
    fitted = fit(record, brake, "printed")
    assert np.all(np.isfinite(fitted.covariance))
    assert "c" in {n.symbol for n in estimates(fitted) if n.told == "poorly"}

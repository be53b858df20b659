"""Free-running prediction of another record."""

from dataclasses import replace

import numpy as np
import pytest

from hil.identify.coverage import with_noise
from hil.identify.validation import error, halves, validate


def test_predicts_another_record_of_the_same_truth_to_its_noise(fitted, clean, brake):
    found = validate(fitted["printed"], with_noise(clean["printed"], "white", 77), brake)
    assert found.whole.torque_rms_nm == pytest.approx(2.05, rel=0.1)
    assert found.whole.temperature_rms_k == pytest.approx(0.4, rel=0.1)
    assert found.start.mu == pytest.approx(0.42, abs=0.02)


def test_looks_only_at_the_first_seconds(fitted, clean, brake):
    record = with_noise(clean["printed"], "white", 77)
    late = record.time_s > 10.0
    spoilt = replace(record, torque_nm=np.where(late, 0.0, record.torque_nm))
    seen, unseen = (validate(fitted["printed"], given, brake).course.mu for given in (record, spoilt))
    assert np.array_equal(seen, unseen)


def test_errors_by_hand(noisy, study):
    record = noisy["printed"]
    course = replace(study.best.course, torque_nm=record.torque_nm + 3.0, temperature_k=record.temperature_k - 2.0)
    whole = error(record, course, np.ones(record.time_s.size, dtype=bool))
    assert (whole.torque_rms_nm, whole.torque_bias_nm) == pytest.approx((3.0, 3.0))
    assert (whole.temperature_rms_k, whole.temperature_bias_k) == pytest.approx((2.0, -2.0))
    assert whole.torque_share == pytest.approx(3.0 / record.torque_nm.mean())
    assert error(record, course, record.time_s < 20.0).torque_share == whole.torque_share  # same mean torque
    first, second = halves(record, course)
    assert (first.from_s, second.to_s) == (0.0, record.time_s[-1])
    assert first.to_s < second.from_s


def test_shipped_records_show_what_the_paper_says(study):
    """Good overall, less so at low temperature, and the mean torque grows with the warming."""
    validation = study.validation
    first, second = validation.halves
    assert validation.whole.torque_share < 0.03
    assert first.torque_rms_nm > 1.3 * second.torque_rms_nm
    quarter = validation.record.time_s.size // 4
    for torque in (validation.record.torque_nm, validation.course.torque_nm):
        assert torque[-quarter:].mean() > 1.15 * torque[:quarter].mean()

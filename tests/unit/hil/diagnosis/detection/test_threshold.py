"""The detection threshold: number of tests, inflation, amplitude."""

import numpy as np
import pytest

from hil.diagnosis.detection.threshold import DetectionThreshold, chi2_quantile


def test_more_tests_need_more_gain() -> None:
    assert chi2_quantile(1, 0.05) == pytest.approx(3.841, abs=1e-3)
    assert chi2_quantile(100, 0.003) > chi2_quantile(10, 0.003) > chi2_quantile(1, 0.003)


def test_the_least_inflation_counts() -> None:
    threshold = DetectionThreshold(126)
    assert threshold.gain == np.inf
    raised = threshold.lowered(3.0)
    assert raised.gain == pytest.approx(3.0 * raised.uninflated_gain)
    assert raised.lowered(5.0) == raised
    assert raised.lowered(1.0).gain == pytest.approx(20.0, abs=0.5)


def test_a_value_needs_some_three_and_a_half_standard_deviations() -> None:
    assert DetectionThreshold(126).amplitude == pytest.approx(3.5, abs=0.1)

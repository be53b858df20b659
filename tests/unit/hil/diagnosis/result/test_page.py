import numpy as np

from hil.diagnosis.result.page import _mean


def test_a_row_of_which_nothing_is_known_has_no_mean_and_no_warning():
    """Warnings are errors here; users saw one of a mean of nothing."""
    known = _mean(np.array([[1.0, 3.0], [np.nan, 2.0], [np.nan, np.nan]]))
    np.testing.assert_array_equal(known, [2.0, 2.0, np.nan])

"""A diagnosis frees its Jacobians, some hundreds of megabytes, when it is done: many are run in a row."""

import gc

import numpy as np
import pytest
from outsider import VEHICLE, drive

from hil.diagnosis.estimation.gauss_newton import Fitter
from hil.diagnosis.explain import explain


def _alive() -> int:
    return sum(isinstance(one, Fitter) for one in gc.get_objects())


@pytest.mark.slow
def test_a_diagnosis_leaves_nothing_to_the_collector() -> None:
    """It kept itself alive, 0.6 GB a case, until the collector came, which few large arrays do not call."""
    log = drive("stops", 7, lambda v, p: np.ones(4))
    gc.collect()
    gc.disable()
    try:
        before, answer = _alive(), explain([log], VEHICLE)
        assert _alive() == before + 1  # that of the answer
        del answer
        assert _alive() == before
    finally:
        gc.enable()

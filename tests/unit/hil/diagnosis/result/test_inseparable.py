"""What is the same as a cause in these logs stands beside it as a rival, never before it."""

from types import SimpleNamespace

import numpy as np
import pytest

from hil.diagnosis.result.causes import _inseparable

PADS = {
    "effect": "pad_mu_gain", "title": "", "location": "front", "injection_point": "friction.mu", "probability": 0.9,
    "step": 1, "parameters": {"gain": {"value": -0.1, "unit": "", "ci95": [-0.12, -0.08]}}, "onset": None,
}  # fmt: skip


def _diagnosis(speed_mps):
    channels = {"speed_mps": np.repeat([20.0, speed_mps], 50)}
    return SimpleNamespace(
        dataset=SimpleNamespace(recordings=[SimpleNamespace(log=SimpleNamespace(channels=channels))]),
        vehicle=SimpleNamespace(undiagnosable_effects=()),
    )


def test_a_calliper_that_grips_unlike_backward_shares_the_probability_of_the_pads():
    cause = dict(PADS)
    (rival,) = _inseparable(_diagnosis(0.0), [cause], [])
    assert (rival["effect"], rival["location"]) == ("caliper_asymmetry", "front")
    assert rival["parameters"]["gain"]["value"] == -0.1
    assert cause["probability"] + rival["probability"] == pytest.approx(0.9)


def test_backward_or_beyond_its_bounds_it_is_none():
    strong = PADS | {"parameters": {"gain": {"value": -0.5, "unit": "", "ci95": [-0.6, -0.4]}}}
    assert _inseparable(_diagnosis(-2.0), [dict(PADS)], []) == []
    assert _inseparable(_diagnosis(0.0), [strong], []) == []

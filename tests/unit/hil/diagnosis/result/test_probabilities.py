"""Causes and rivals of one step share one probability."""

from types import SimpleNamespace

import pytest

from hil.diagnosis.isolation.groups import IsolabilityGroup
from hil.diagnosis.result.probabilities import with_imitations

NAMES = ("pad_mu_gain", "mass_offset", "headwind", "pressure_gain", "cog_height")
CANDIDATES = [SimpleNamespace(effect=SimpleNamespace(name=name)) for name in NAMES]


def test_rivals_that_nothing_tells_from_the_cause_share_its_probability():
    group = IsolabilityGroup((1,), (1.0,), 0.0, 20.0, ((1, 0.0), (3, 0.0)))
    shares = with_imitations({"pad_mu_gain": 1.0}, "pad_mu_gain", group, CANDIDATES)
    assert shares == pytest.approx({"pad_mu_gain": 1 / 3, "mass_offset": 1 / 3, "pressure_gain": 1 / 3})


def test_rivals_that_imitate_together_are_one_hypothesis():
    group = IsolabilityGroup((1, 2), (1.0, 1.0), 0.0, 20.0, ())
    shares = with_imitations({"pad_mu_gain": 1.0}, "pad_mu_gain", group, CANDIDATES)
    assert shares == pytest.approx({"pad_mu_gain": 0.5, "mass_offset": 0.25, "headwind": 0.25})


def test_fitted_rivals_count_once_and_all_add_up_to_one():
    """0.9 and 0.49 stood beside each other: together 1.39."""
    group = IsolabilityGroup((1,), (1.0,), 0.3, 20.0, ((1, 0.3), (4, 1.9)))
    shares = with_imitations({"pad_mu_gain": 0.9, "mass_offset": 0.1}, "pad_mu_gain", group, CANDIDATES)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["pad_mu_gain"] > shares["mass_offset"] > shares["cog_height"] > 0.0


def test_without_a_group_the_fitted_ones_keep_their_share():
    alone = IsolabilityGroup((), (), 20.0, 20.0, ())
    assert with_imitations({"pad_mu_gain": 0.8, "headwind": 0.2}, "pad_mu_gain", alone, CANDIDATES) == pytest.approx(
        {"pad_mu_gain": 0.8, "headwind": 0.2}
    )

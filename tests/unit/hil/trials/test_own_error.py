"""The model's own error as a table: what is measured counts, few cases are drawn to the usual, never below 1."""

import tomllib

import pytest

from hil.study.own_error import USUAL
from hil.trials.own_error import as_toml, ratios


def test_many_cases_tell_the_ratio_and_none_tell_the_usual() -> None:
    table = ratios({("mass_offset", "mass_kg"): [16.0] * 1000, ("headwind", "wind_mps"): []})
    assert table["mass_offset"]["mass_kg"] == pytest.approx(4.0, abs=0.02)
    assert table["headwind"]["wind_mps"] == USUAL


def test_a_number_that_shows_less_than_noise_has_ratio_one() -> None:
    assert ratios({("cogging", "amplitude_nm"): [0.1] * 1000}) == {"cogging": {"amplitude_nm": 1.0}}


def test_the_file_reads_back_and_says_how_it_was_made() -> None:
    text = as_toml({"imu_gain": {"gain": 2.5, "cross": 1.0}}, 12, 777)
    assert tomllib.loads(text) == {"ratio": {"imu_gain": {"gain": 2.5, "cross": 1.0}}}
    assert "--own-error FILE --count 12 --seed 777" in text

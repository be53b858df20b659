"""The model's own error as a table: what is measured counts, few looks are drawn to the usual, never below 1."""

import tomllib

import pytest

from hil.diagnosis.estimation.model_discrepancy import UNMEASURED_RATIO
from hil.validation.blind_trials.discrepancy_table import as_toml, ratios, tables


def test_many_cases_tell_the_ratio_and_none_tell_the_usual() -> None:
    table = ratios({("mass_offset", "mass_kg", "car"): [16.0] * 1000, ("headwind", "wind_mps", "car"): []})
    assert table["mass_offset"]["mass_kg"]["car"] == pytest.approx(4.0, abs=0.02)
    assert table["headwind"]["wind_mps"]["car"] == UNMEASURED_RATIO


def test_what_the_form_does_to_all_wheels_alike_is_not_laid_on_one() -> None:
    table = ratios({("pad_mu_gain", "gain", "car"): [9.0] * 1000, ("pad_mu_gain", "gain", "wheel"): [1.0] * 1000})
    assert table["pad_mu_gain"]["gain"]["car"] == pytest.approx(3.0, abs=0.02)
    assert table["pad_mu_gain"]["gain"]["wheel"] == 1.0


def test_a_number_that_shows_less_than_noise_has_ratio_one() -> None:
    found = ratios({("cogging", "amplitude_nm", "axle"): [0.1] * 1000})
    assert found == {"cogging": {"amplitude_nm": {"axle": 1.0}}}


def test_what_errs_more_without_springs_is_told_apart() -> None:
    height, mass = ("cog_height", "height_m", "car"), ("mass_offset", "mass_kg", "car")
    found = tables({height: [1.0] * 1000, mass: [4.0] * 1000}, {height: [9.0] * 1000, mass: [1.0] * 1000})
    assert found["unsprung"] == {"cog_height": {"height_m": {"car": pytest.approx(3.0, abs=0.02)}}}
    assert found["ratio"]["cog_height"]["height_m"]["car"] == pytest.approx(1.0, abs=0.02)
    assert found["ratio"]["mass_offset"]["mass_kg"]["car"] == pytest.approx(2.0, abs=0.02)


def test_the_file_reads_back_and_says_how_it_was_made() -> None:
    table = {"imu_gain": {"gain": {"imu": 2.5}, "cross": {"imu": 1.0}}, "unlisted": {"drag(time)": {"car": 1.2}}}
    both = {"ratio": table, "unsprung": {"cog_height": {"height_m": {"car": 1.8}}}}
    text = as_toml(both, 30, 777)
    assert tomllib.loads(text) == both
    assert "--own-error FILE --count 30 --seed 777" in text

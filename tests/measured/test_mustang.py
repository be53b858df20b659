"""A Mustang in a yard, prepared from its log alone: units, signs and lags; wheels that spin; no filter that is none."""

from pathlib import Path

import pytest
import strange_logs

from dbc.database import parse_database
from hil.diagnosis.draft.drafting import draft
from hil.diagnosis.draft.files import write_draft
from hil.diagnosis.draft.guess import Draft, Guess
from hil.diagnosis.draft.signals import read_signals
from hil.diagnosis.explain import explain

pytestmark = [pytest.mark.slow, pytest.mark.long]
SHEET = {"mass_kg": 1750.0, "wheelbase_m": 2.72, "cog_to_front_axle_m": 1.28, "rolling_radius_m": 0.334}


@pytest.fixture(scope="module")
def files(measured_data) -> tuple[Path, Path]:
    return measured_data / "mustang" / "hs.log", measured_data / "mustang" / "mustang.dbc"


@pytest.fixture(scope="module")
def drafted(files) -> Draft:
    log, dbc = files
    return draft(read_signals([log], parse_database(dbc.read_bytes(), str(dbc))))


def _of(found: Draft, channel: str) -> Guess:
    return next(one for one in found.guesses if one.channel == channel)


def test_the_wheel_speeds_are_not_in_the_unit_of_the_notes(drafted: Draft) -> None:
    wheel = _of(drafted, "wheel_speed_fl_rad_s")
    assert wheel.unit == "rad/s"
    assert any("stated is km/h" in text for text in wheel.unknown)
    assert any("rear wheels run up to 30 %" in text for text in wheel.measured)
    (radius,) = (one for one in drafted.numbers if one.key == "rolling_radius_m")
    assert radius.value is None
    assert "0.339 m" in radius.text
    assert "0.326 m" in radius.text


def test_two_accelerometers_with_their_lags(drafted: Draft) -> None:
    ax = _of(drafted, "ax_mps2")
    assert (ax.signal, ax.unit, ax.sign) == ("ACCELERATION_GROUND.AX", "m/s2", 1)
    assert ax.evidence is not None
    assert 1.0 < ax.evidence.low < ax.evidence.high < 1.1
    assert ax.evidence.lag_s == pytest.approx(0.013, abs=0.02)
    assert any("AX_CAR" in text and "167 ms late" in text for text in ax.measured)


def test_what_the_brake_message_supports(drafted: Draft) -> None:
    pressure = _of(drafted, "pressure_fl_pa")
    assert (pressure.signal, pressure.complete) == ("BRAKE_PRESSURE.PEDAL_PRESSURE_RAW", False)
    assert "counter" in drafted.left_out["BRAKE_PRESSURE.CIRCUIT_PRESSURE_RAW"]
    (gain,) = (one for one in drafted.numbers if one.key == "brake_gain_front_nm_pa")
    assert float(gain.text.split("= ")[1].split()[0]) == pytest.approx(0.0049, rel=0.05)
    assert drafted.missing == ("mass_kg", "wheelbase_m", "cog_to_front_axle_m", "rolling_radius_m")


@pytest.mark.parametrize(("unit", "verdict"), [("rad/s", "none"), ("km/h", "named")])
def test_explain_with_the_drafted_unit_and_with_that_of_the_notes(files, drafted, tmp_path, unit, verdict) -> None:
    log, dbc = files
    map_file, set_file = write_draft(drafted, tmp_path)
    strange_logs.fill_in(set_file, SHEET)
    set_file.write_text(set_file.read_text("utf-8") + "mass_kg_tolerance = 80.0\nrolling_radius_m_tolerance = 0.01\n")
    map_file.write_text(map_file.read_text("utf-8").replace('unit = "rad/s"', f'unit = "{unit}"'))
    found = explain([log], set_file, channel_map=map_file, database=dbc).json
    assert found["verdict"] == verdict
    assert any("the car's speed is that of the front wheels" in text for text in found["remarks"])
    assert found["held_out_error"]["ax_mps2"]["after"] < 0.6
    if verdict == "named":
        (cause,) = found["causes"]
        assert cause["effect"] == "wrong_scale"
        low, high = cause["parameters"]["gain"]["ci95"]
        assert 0.15 < low < 0.22 < high < 0.28

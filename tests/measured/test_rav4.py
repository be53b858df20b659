"""A Toyota RAV4 on a road: what is wrong is named, a term left out is found again, a fault put in has its name."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dbc.database import parse_database
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import WHEEL_SPEED, Log
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.explain import explain, shipped

pytestmark = [pytest.mark.slow, pytest.mark.long]


@pytest.fixture(scope="module")
def log(measured_data) -> Log:
    database = parse_database((measured_data / "rav4" / "toyota_new_mc_pt.dbc").read_bytes(), "toyota")
    mapped = load_map(shipped(Path("toyota_rav4"), "map"))
    return read_logs([measured_data / "rav4" / "bus0.log"], database, mapped)[0]


@pytest.fixture(scope="module")
def answer(log, shared):
    return shared("rav4", lambda folder: explain(log, "toyota_rav4", out=folder).json)


def _again(log: Log, extension: Path) -> dict:
    return explain(log, "toyota_rav4", extend=extension).json


def _cause(answer: dict, effect: str, channel: str) -> dict:
    found = [c for c in answer["causes"] if c["effect"] == effect and channel in c["channels"]]
    assert found, f"{effect} on {channel} not among {[(c['effect'], c['channels']) for c in answer['causes']]}"
    return found[0]


def _with(log: Log, **changed) -> Log:
    return replace(log, channels={**log.channels, **changed})


def test_the_accelerometers_read_the_wrong_way_round(answer):
    along = _cause(answer, "wrong_scale", "ax_mps2")["parameters"]["gain"]
    assert along["ci95"][0] < -2.0 < along["ci95"][1] < -1.5
    across = _cause(answer, "wrong_scale", "ay_mps2")["parameters"]["gain"]
    assert across["ci95"][1] < -1.0
    assert answer["verdict"] == "named"


def test_the_wheels_slip_and_the_gyro_has_a_zero(answer):
    """Slip of tyres as any, which leads the car by 0.05 to 0.1 s, was told as a filter of the accelerometer."""
    assert not [c for c in answer["causes"] if c["effect"] in ("imu_filter", "timestamp_offset")]
    (said,) = [text for text in answer["remarks"] if "wheels slip" in text]
    assert 0.002 < float(said.split()[4]) < 0.008
    zero = _cause(answer, "imu_bias", "yaw_rate_rad_s")["parameters"]["yaw_rate_rad_s"]
    assert zero["ci95"][1] < -0.002


def test_held_out_the_error_falls_to_the_roads_slope(answer):
    gain = answer["held_out_error"]["ax_mps2"]
    assert gain["ci95"][1] < 0.4 * gain["before"]
    assert gain["after"] < 0.5 * gain["best_wrong"]


def test_what_needs_forces_is_refused_with_what_it_takes(answer):
    assert {"pad_mu_gain", "mass_offset", "pad_temp_fade", "iwm_gain"} <= set(answer["undetectable_effects"])
    assert "pressure" in answer["needs"]["pad_mu_gain"]
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer


def test_with_what_was_taught_nothing_is_left(log, answer):
    left = _again(log, Path(answer["extension"]))
    assert (left["verdict"], left["causes"]) == ("none", [])


@pytest.mark.parametrize(
    ("table", "number", "effect", "channel"),
    [
        ("along", "gain", "wrong_scale", "ax_mps2"),
        ("turning", "yaw_bias_rad_s", "imu_bias", "yaw_rate_rad_s"),
    ],
)
def test_a_term_left_out_is_found_again_by_name(log, answer, tmp_path, table, number, effect, channel):
    taught = tomllib.loads(Path(answer["extension"]).read_text())["channels"]
    whole = taught[table][number]
    del taught[table][number]
    extension = tmp_path / "without.toml"
    lines = [f"[channels.{t}]\n" + "".join(f"{n} = {v!r}\n" for n, v in ns.items()) for t, ns in taught.items()]
    extension.write_text("\n".join(lines))
    found = _again(log, extension)
    (entry,) = _cause(found, effect, channel)["parameters"].values()
    assert entry["ci95"][0] <= whole <= entry["ci95"][1]


def test_a_late_accelerometer_is_named(log, answer):
    ax, late = log.channels["ax_mps2"], 20  # rows of 10 ms
    felt = np.concatenate((np.full(late, ax[0]), ax[:-late]))
    found = _again(_with(log, ax_mps2=felt), Path(answer["extension"]))
    delay = _cause(found, "timestamp_offset", "ax_mps2")
    assert delay["location"] == "imu"
    assert delay["parameters"]["delay_s"]["value"] == pytest.approx(0.2, abs=0.06)


def test_a_larger_wheel_is_named(log, answer):
    name = WHEEL_SPEED[2]
    found = _again(_with(log, **{name: 0.98 * log.channels[name]}), Path(answer["extension"]))
    wheel = _cause(found, "tyre_radius", "wheel_speed_rl_rad_s")
    assert wheel["location"] == "rl"
    assert wheel["parameters"]["gain"]["value"] == pytest.approx(0.02, abs=0.004)


def test_a_wrong_unit_of_the_accelerometer_is_named(log, answer):
    found = _again(_with(log, ax_mps2=log.channels["ax_mps2"] / 9.80665), Path(answer["extension"]))
    factor = _cause(found, "wrong_scale", "ax_mps2")["parameters"]["gain"]
    assert factor["ci95"][0] < 1.0 / 9.80665 - 1.0 < factor["ci95"][1]

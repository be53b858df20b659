"""A race car braking: which channel lies, what the stops support; faults put into the recording have their names."""

from dataclasses import replace
from pathlib import Path

import pytest

from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import PRESSURE_DEMAND, Log
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.explain import explain, shipped

pytestmark = [pytest.mark.slow, pytest.mark.long]


@pytest.fixture(scope="module")
def log(measured_data) -> Log:
    return read_logs([measured_data / "av21" / "putnam_run4_2.csv"], None, load_map(shipped(Path("av21"), "map")))[0]


@pytest.fixture(scope="module")
def answer(log, shared):
    return shared("av21", lambda folder: explain(log, "av21", out=folder).json)


def _cause(answer: dict, effect: str, wheel: str) -> dict:
    found = [c for c in answer["causes"] if c["effect"] == effect and c["location"] == wheel]
    assert found, f"{effect} of {wheel} not among {[(c['effect'], c['location']) for c in answer['causes']]}"
    return found[0]


def test_the_channels_that_lie(answer):
    slow = _cause(answer, "imu_filter", "imu")["parameters"]["time_s"]
    assert 2.0 < slow["ci95"][0] < slow["ci95"][1] < 2.8
    late = _cause(answer, "timestamp_offset", "pressure")["parameters"]["delay_s"]
    assert 0.3 < late["ci95"][0] < late["ci95"][1] < 0.5
    ahead = _cause(answer, "imu_position", "imu")["parameters"]["x_m"]
    assert -1.2 < ahead["ci95"][0] < ahead["ci95"][1] < -0.8
    assert any("feels no road" in text for text in answer["remarks"])
    gain = answer["held_out_error"]["ax_mps2"]
    assert gain["ci95"][1] < 0.05 * gain["before"]


def test_what_the_stops_support(answer):
    gain = answer["estimates"]["deceleration_per_pressure"]
    assert 2e-6 < gain["ci95"][0] < gain["ci95"][1] < 4e-6
    assert {"pad_temp_fade", "threshold", "valve_leak"} <= set(answer["undetectable_effects"])


def test_faults_put_into_the_recording_have_their_names(log, answer):
    channels = dict(log.channels)
    channels["ax_mps2"] = 1.1 * channels["ax_mps2"]
    channels |= {name: channels[name] + 1e5 for name in PRESSURE_DEMAND}
    found = explain(replace(log, channels=channels), "av21", extend=Path(answer["extension"])).json
    scale = _cause(found, "imu_gain", "imu")["parameters"]["gain"]
    assert scale["value"] == pytest.approx(0.1, abs=0.02)
    offset = _cause(found, "pressure_offset", "pressure")["parameters"]["offset_pa"]
    assert offset["value"] == pytest.approx(1e5, rel=0.1)

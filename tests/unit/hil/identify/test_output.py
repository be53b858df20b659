"""What people and programs get: report, figures, JSON, pad table."""

import json
from dataclasses import replace

import pytest

from hil.identify.coverage import TRUTHS, Covered
from hil.identify.files import as_json, coverage_json, pad_toml
from hil.identify.study import identify
from hil.identify.summary import build_report, figures
from hil.report.figure import write_figure
from hil.report.html import render_html
from hil.report.text import render_text
from hil.scenario.parameters import load_set
from plant.parameters.brakes import OstermeyerParameters


def test_pad_table_is_read_back_as_the_plants(study, friction_brake, tmp_path):
    path = tmp_path / "pad.toml"
    path.write_text(pad_toml(study, 0, friction_brake))
    pad = load_set(path, OstermeyerParameters)
    fitted = study.best.pad
    assert (pad.a_1_ks, pad.b_1_j, pad.c_1_s, pad.epsilon_w) == pytest.approx(
        (fitted.a, fitted.b, fitted.c, fitted.eps), rel=1e-5
    )
    front, rear = pad.gamma_k_w
    capacity = friction_brake.heat_capacity_j_k
    assert front == pytest.approx(fitted.gamma, rel=1e-5)
    assert rear == pytest.approx(fitted.gamma * capacity[0] / capacity[1], rel=1e-5)
    assert pad.heating_with_mu == float(study.heating == "friction")
    assert "synthetic" in path.read_text()


def test_pad_table_of_a_rear_brake_with_a_name_that_would_end_the_string(noisy, brake, friction_brake, tmp_path):
    record = replace(noisy["printed"], name='a"b\\c\n.csv')
    path = tmp_path / "pad.toml"
    path.write_text(pad_toml(identify(record, brake, heating="printed"), 1, friction_brake))
    pad = load_set(path, OstermeyerParameters)
    assert pad.gamma_k_w[1] == pytest.approx(TRUTHS["printed"].gamma, rel=0.05)
    assert pad.gamma_k_w[0] < pad.gamma_k_w[1]


def test_json_is_whole_and_strict(study):
    text = json.dumps(as_json(study), allow_nan=False)
    told = json.loads(text)
    assert [n["symbol"] for n in told["parameters"]] == ["a", "b", "c", "gamma", "eps"]
    assert told["heating"] in told["forms"]
    assert len(told["correlation"]) == 5
    assert told["validation"]["torque_rms_nm"] == study.validation.whole.torque_rms_nm
    assert len(told["validation_halves"]) == len(told["identification_halves"]) == 2
    assert told["record"]["remarks"][0].startswith("SYNTHETIC")


def test_without_a_second_record_nothing_is_made_up(shipped, brake):
    alone = identify(shipped[0], brake, heating="printed")
    told = as_json(alone)
    assert told["validation"] is told["validation_halves"] is told["repeat"] is None
    assert list(figures(alone)) == ["figure3_inputs.png", "figure4_identification.png"]
    assert "Figure 5" not in render_text(build_report(alone, {}))


def test_report_says_what_was_found_and_that_it_is_synthetic(study):
    text = render_text(build_report(study, {"version": "x"}), width=120)
    for part in (
        "(synthetic)",
        "Figure 3",
        "Figure 4",
        "Figure 5",
        "first half",
        "poorly",
        "gamma in K/W",
        "Mean torque",
    ):
        assert part in text
    assert all(len(line) <= 120 for line in text.splitlines())
    assert "figure" in render_html(build_report(study, {})).lower()


def test_figures_are_drawn(study, tmp_path):
    drawn = figures(study)
    assert list(drawn) == ["figure3_inputs.png", "figure4_identification.png", "figure5_validation.png"]
    for name, report in drawn.items():
        write_figure(report, tmp_path / name, dpi=40)
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_coverage_json():
    good, bad = Covered("printed", "white", 50, 49, 46, 50), Covered("printed", "white", 50, 40, 46, 50)
    assert coverage_json([good])["met"] is True
    assert coverage_json([good, bad])["met"] is False

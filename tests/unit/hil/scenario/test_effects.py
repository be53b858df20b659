import json
from pathlib import Path

import numpy as np
import pytest

from hil.bench.virtual import simulate
from hil.cli.main import main
from hil.scenario.effects import NONE, EffectError, read_effects
from hil.scenario.scenario import load_scenario
from hil.validation.doc_pages.effects_page import page
from hil.validation.sensitivities import alike, recorded, signatures
from plant.effects.catalogue import BUILT_IN
from plant.injection.theta import THETA

ROOT = Path(__file__).parents[4]
WHERE = "a.toml: effects"
SHORT = (
    'title = "short"\n[start]\nspeed_mps = 10.0\n[driver]\npedal = [[0.1, 0.0], [0.2, 0.5]]\n[end]\nduration_s = 1.0\n'
)


def scenario(tmp_path, more=""):
    path = tmp_path / "short.toml"
    path.write_text(SHORT + more)
    return load_scenario(str(path))


def test_documentation_is_current():
    assert (ROOT / "docs" / "effects.md").read_text(encoding="utf-8") == page(BUILT_IN), (
        "run python -m hil.validation.doc_pages.effects_page"
    )


def test_an_empty_table_means_the_usual_size():
    effects = read_effects({"pad_temp_fade": {}}, WHERE)
    np.testing.assert_array_equal(effects.theta, THETA.typical("pad_temp_fade"))


def test_at_names_the_members():
    effects = read_effects({"stuck_corner": {"at": ["fl"], "loss": 0.5, "onset_s": 2.0}}, WHERE)
    assert effects.theta[THETA.slice("stuck_corner", "loss")].tolist() == [0.5, 0.0, 0.0, 0.0]
    assert effects.theta[THETA.slice("stuck_corner", "held_pa")].tolist() == [0.0] * 4


def test_what_acts_at_an_injection_point_is_taken_out_and_all_else_left():
    law = {
        "injection_point": "friction.mu",
        "variable": "speed",
        "centre": 10.0,
        "width": 5.0,
        "value": 0.1,
        "at": ["rl"],
    }
    drag = law | {"injection_point": "body.force", "value": -50.0, "adds": True}
    del drag["at"]
    weak = {"pad_mu_gain": {"gain": -0.3, "onset_s": 2.0}, "mass_offset": {"mass_kg": 90.0}}
    all_of_it = read_effects({**weak, "laws": [law, drag]}, WHERE)
    left = all_of_it.without("friction.mu", "brake.torque")
    alone = read_effects({"mass_offset": {"mass_kg": 90.0}, "laws": [drag]}, WHERE)
    np.testing.assert_array_equal(left.theta, alone.theta)
    np.testing.assert_array_equal(left.terms, alone.terms)
    assert left.on == ("mass_offset",)
    assert all_of_it.on == ("pad_mu_gain", "mass_offset")


def test_none_is_none():
    assert read_effects({}, WHERE) is NONE


@pytest.mark.parametrize(
    ("tables", "error"),
    [
        ({"pad_temp_fate": {}}, "did you mean pad_temp_fade"),
        ({"pad_temp_fade": 3}, "expected a table"),
        ({"pad_temp_fade": {"fade": 3}}, "has no parameter 'fade'"),
        ({"pad_temp_fade": {"fade_1_k": "hot"}}, "a.toml: effects.pad_temp_fade"),
        ({"stuck_corner": {"at": ["left"]}}, "expected some of fl, fr, rl, rr"),
        ({"road_grade": {"grade": 2.0}}, "expected -0.2 to 0.2"),
        ({"timestamp_offset": {"delay_s": {"imu": -0.004}}}, r"delay_s: expected 0 or more, got -0.004 \(imu\)"),
        ({"clock_drift": {"share": {"motor": -1e-4}}}, r"share: expected 0 or more, got -0.0001 \(motor\)"),
        ({"speed_scale": {"gain": 0.01}}, r"speed_scale.gain: expected 0, got 0.01: no bus of the bench has a sensor"),
    ],
)
def test_refusals_say_where_and_what(tables, error):
    with pytest.raises(EffectError, match=error):
        read_effects(tables, WHERE)


def test_a_scenario_switches_an_effect_on_in_time(tmp_path):
    plain = simulate(scenario(tmp_path))
    late = simulate(scenario(tmp_path, "[effects.imu_bias]\nax_mps2 = 0.8\nonset_s = 0.5\n"))
    times, before = plain.get("BODY_MOTION.LONGITUDINAL_ACCELERATION")
    _, after = late.get("BODY_MOTION.LONGITUDINAL_ACCELERATION")
    added = after - before
    begun = np.flatnonzero(np.abs(added) > 0.4)
    assert times[begun[0]] == pytest.approx(0.5, abs=0.02)
    assert added[begun[0] : begun[0] + 5] == pytest.approx(0.8, abs=0.011)  # later the controller answers


def test_command_lists_and_shows(capsys):
    assert main(["effects"]) == 0
    assert "pad_temp_fade" in capsys.readouterr().out
    assert main(["effects", "pad_temp_fade"]) == 0
    assert "start_k 400 to 800 K" in capsys.readouterr().out
    assert main(["effects", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["effects"]
    assert {effect["name"] for effect in listed} >= {effect.name for effect in BUILT_IN}
    assert main(["effects", "glue"]) == 2


def test_sensitivities_of_a_scenario(tmp_path, capsys):
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    assert main(["sensitivities", str(path), "--out", str(tmp_path / "out"), "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    by_name = {(effect["name"], effect["member"]): effect for effect in table["effects"]}
    assert by_name["pad_mu_gain", "fl"]["shown"]
    assert "hot_spot front" in table["not_shown"]
    assert by_name["pressure_offset", "fl"]["rms_over_noise"]["pressure_fl_pa"] == pytest.approx(10.0)
    assert by_name["pressure_offset", "fl"]["rms_over_noise"]["pressure_fr_pa"] == 0.0
    assert (tmp_path / "out" / "sensitivities_short.png").stat().st_size > 20_000
    assert len((tmp_path / "out" / "sensitivities_short.csv").read_text().splitlines()) == 1 + len(table["effects"])


def test_what_cannot_be_told_apart_is_said(tmp_path):
    found = signatures(recorded(scenario(tmp_path)))
    pairs = {frozenset(pair[:2]) for pair in alike(found)}
    assert frozenset({"pad_mu_gain fl", "caliper_asymmetry fl"}) in pairs

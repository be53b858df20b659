"""From logs to the answer, on logs that the plant itself made: nothing in nothing, a hidden drag by its name."""

import json
from pathlib import Path

import numpy as np
import pytest
from plant_logs import STEP_S, log, logs

from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.explain import explain
from hil.diagnosis.result.page import build_report
from hil.diagnosis.vehicle.extension_file import load_extension
from hil.report.text import render_text
from plant.injection.theta import THETA


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_nothing_is_found_in_nothing() -> None:
    answer = explain(logs(THETA.neutral(), 5))
    assert answer.json["verdict"] == "none"
    assert answer.json["causes"] == []
    assert answer.json["headline"].startswith("Nothing beyond noise and the stated tolerances")
    assert json.loads(json.dumps(answer.json))["held_out_error"]["wheel_speed"]["after"] > 0.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hidden_drag_is_named_extended_and_then_nothing_is_left(tmp_path: Path) -> None:
    theta = THETA.set(THETA.neutral(), "residual_drag", {"torque_nm": {"rl": 30.0}})
    dragging = logs(theta, 6)
    answer = explain(dragging, out=tmp_path)
    found = answer.json
    assert found["causes"][0]["effect"] == "residual_drag"
    assert found["causes"][0]["location"] == "rl"
    assert found["causes"][0]["parameters"]["torque_nm"]["value"] == pytest.approx(30.0, rel=0.3)
    assert found["headline"].startswith("Rear left pads drag with the brake released, ")
    moved = {one["key"]: one for one in found["moved_numbers"]}
    assert moved["mass_kg"]["ci95"][0] < moved["mass_kg"]["estimate"] < moved["mass_kg"]["ci95"][1]
    for step in {entry["step"] for entry in found["causes"]}:
        competing = [one for one in (*found["causes"], *found["rivals"]) if one["step"] == step]
        assert sum(one["probability"] for one in competing) <= 1.0 + 1e-9
    printed = render_text(build_report(answer, ["logs"]))
    assert "tuned alone" in printed
    assert "Numbers that moved" in printed
    assert "residual_drag" not in printed.split("Score test")[0].split("profile fits")[0]
    taught = load_extension(tmp_path / "extension.toml")
    assert taught.theta[THETA.slice("residual_drag", "torque_nm")][2] == pytest.approx(30.0, rel=0.3)
    assert explain(dragging, extend=tmp_path / "extension.toml").json["causes"] == []


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_drag_that_begins_in_the_middle_is_named_with_its_time(tmp_path: Path) -> None:
    dragging = THETA.set(THETA.neutral(), "residual_drag", {"torque_nm": {"rl": 40.0}})
    beginning = dragging.copy()
    beginning[THETA.slice("residual_drag", "onset_s")] = 5.0
    drives = [log(theta, 8, k) for k, theta in enumerate((THETA.neutral(), beginning, dragging))]
    found = explain(drives, out=tmp_path).json
    (cause,) = found["causes"]
    assert (cause["effect"], cause["location"]) == ("residual_drag", "rl")
    assert cause["onset"]["log"].endswith("1")
    assert cause["onset"]["t_s"] == pytest.approx(5.0, abs=0.1)
    assert cause["onset_s"] == pytest.approx(14.0 + 5.0, abs=0.1)
    assert f" s of {cause['onset']['log']} on" in found["headline"]
    (onset,) = load_extension(tmp_path / "extension.toml").onsets.values()
    assert onset == (cause["onset"]["log"], pytest.approx(5.0, abs=0.1))


def test_without_motion_or_torque_there_is_no_answer() -> None:
    t = np.arange(500) * STEP_S
    with pytest.raises(UnusableError, match="how the car moved"):
        explain({"t_s": t, "ax_mps2": np.zeros(500)})
    with pytest.raises(UnusableError, match="what braked the car"):
        explain({"t_s": t, "speed_mps": np.full(500, 20.0)})


def _written(folder: Path) -> Path:
    t = np.arange(500) * STEP_S
    np.savetxt(folder / "a.csv", np.column_stack((t, 20.0 - t)), delimiter=",", header="t_s,speed_mps", comments="")
    return folder / "a.csv"


def test_a_table_of_nobodys_car_is_refused_and_the_shipped_car_is_had_by_its_name(tmp_path: Path) -> None:
    with pytest.raises(UnusableError, match=r"a.csv: .*give --vehicle SET.toml with mass_kg.*--vehicle paper_car"):
        explain(_written(tmp_path))
    for vehicle in ("paper_car", Path("paper_car")):
        with pytest.raises(UnusableError, match=r"what braked the car; .*columns seen: speed_mps"):
            explain(_written(tmp_path), vehicle)


def test_inputs_are_on_trial_before_any_fit() -> None:
    table = dict(log(THETA.neutral(), 5, 0))
    with pytest.raises(UnusableError, match=r"speed_mps \[km/h\]"):
        explain(table | {"speed_mps": 3.6 * table["speed_mps"]})

"""The oracle knows what was hidden: it must do better than the car tuned without, and no number is made up for it."""

import pytest

from hil.diagnosis.detection.result import Settings
from hil.diagnosis.explain import explain
from hil.diagnosis.result.residual_patterns import WORDS
from hil.validation.blind_trials.oracle import true_model_error
from hil.validation.reference_car.case import Hidden, make_case
from hil.validation.reference_car.files import read_answer, write


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_truth_beats_the_tuned_car_and_half_the_truth(tmp_path) -> None:
    logs = tmp_path / "logs"
    write(make_case((Hidden("road_grade", "car", 0.01),), 11, "low", "cold"), logs)
    answered = explain(logs, logs / "vehicle.toml", settings=Settings(most_causes=0))
    hidden = read_answer(logs)["causes"][0]
    tuned = {WORDS[gain.channel]: gain.tuned for gain in answered.held_out}
    truth = true_model_error(answered.diagnosis, hidden)
    half = true_model_error(answered.diagnosis, hidden | {"parameters": {"grade": {"value": 0.005}}})
    assert set(truth) == set(tuned)
    assert truth["wheel_speed"] < 0.7 * tuned["wheel_speed"]
    assert truth["wheel_speed"] < half["wheel_speed"] < tuned["wheel_speed"]
    judder = {"effect": "dtv_judder", "location": "fl", "parameters": {"amplitude": {"value": 0.05}}}
    assert true_model_error(answered.diagnosis, judder) is None

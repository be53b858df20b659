"""Figures 3 to 5: the friction model identified from dynamometer records (shipped ones are synthetic and say so)."""

from importlib import resources

from hil.identify.model import brake_of
from hil.identify.record import read_record
from hil.identify.study import Study, identify, shipped_records
from hil.scenario.parameters import load_set
from hil.validation.reproduce.study import Row
from plant.parameters.plant import PlantParameters

GOALS = {"4": 5.0, "5": 10.0}  # %; ours: the paper shows the fits and gives no number


def shipped_study() -> Study:
    """The identification of the shipped records."""
    first, second = shipped_records()
    parameters = load_set(resources.files("plant.parameters") / "paper_car.toml", PlantParameters).friction_brake
    return identify(read_record(first), brake_of(parameters, 0, 2), read_record(second))


def identification_rows(study: Study) -> list[Row]:
    """Torque error of identification (Figure 4) and validation (Figure 5), % of the record's mean torque."""
    found = [("4", "friction model fitted to test 1, torque RMSE", max(e.torque_share for e in study.errors))]
    if study.validation is not None:
        found.append(("5", "friction model predicting test 2, torque RMSE", study.validation.whole.torque_share))
    return [
        Row(figure, claim, "%", None, None, 100.0 * share, 100.0 * share, GOALS[figure], "median",
            100.0 * share <= GOALS[figure], "synthetic dynamometer records", 1, None)
        for figure, claim, share in found
    ]  # fmt: skip

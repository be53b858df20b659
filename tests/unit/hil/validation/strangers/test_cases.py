"""Which car hides what, and that `explain` reads what is handed over."""

from collections import Counter

import numpy as np
import pytest

from hil.diagnosis.data.read import read_logs
from hil.errors import BrakebenchError
from hil.validation.strangers.cases import CARS, draw, stated, write
from hil.validation.strangers.snr import Visibility


def test_drives_with_nothing_hidden_are_spread_over_the_cars() -> None:
    cases = [draw("strangers", k, 9) for k in range(3 * len(CARS))]
    assert Counter(case.car.name for case in cases) == dict.fromkeys(CARS, 3)
    assert len({case.seed for case in cases}) == len(cases)
    assert all(case.hidden is None and case.reached for case in cases)
    assert draw("strangers", 2, 9) == cases[2]


def test_a_reference_is_another_drive_of_the_same_car() -> None:
    cases = [draw("strangers_reference", k, 9) for k in range(2 * len(CARS))]
    assert Counter(case.car.name for case in cases) == dict.fromkeys(CARS, 2)
    assert all(case.hidden is None for case in cases)
    assert len({seed for case in cases for seed in (case.seed, case.reference)}) == 2 * len(cases)
    assert draw("strangers", 2, 9).reference is None


@pytest.mark.slow
@pytest.mark.parametrize("index", [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(1, len(CARS)))])
def test_a_single_cause_shows_fifteen_times_the_noise(index) -> None:
    case = draw("strangers_single", index, 9)
    assert case.reached
    seen = Visibility(case.car, case.seed, stated(case.car, case.seed))
    assert seen.snr(case.hidden) == pytest.approx(15.0, rel=0.02)


def test_a_car_hides_all_its_causes_in_turn(monkeypatch) -> None:
    monkeypatch.setattr(Visibility, "__init__", lambda self, car, seed, said: None)
    monkeypatch.setattr(Visibility, "sized", lambda self, cause, target: (cause, target))
    for k, car in enumerate(CARS.values()):
        drawn = [draw("strangers_single", k + n * len(CARS), 9).hidden.name for n in range(len(car.causes))]
        assert sorted(drawn) == sorted(car.causes)


def test_no_other_family_is_drawn() -> None:
    with pytest.raises(BrakebenchError, match="expected one of strangers"):
        draw("null", 0, 9)


@pytest.mark.parametrize("car", CARS.values(), ids=list(CARS))
def test_explain_reads_the_logs_and_nothing_tells_the_answer(car, tmp_path) -> None:
    folder = tmp_path / "logs"
    write(car, 4, None, folder)
    logs = read_logs([folder])
    assert [len(log.t_s) for log in logs] == [len(table["t_s"]) for table in car.drive(4)]
    assert all(np.isfinite(log.channels["ax_mps2"]).any() for log in logs)
    assert {path.suffix for path in folder.iterdir()} == {".parquet", ".toml"}
    with pytest.raises(BrakebenchError, match="not empty"):
        write(car, 4, None, folder)

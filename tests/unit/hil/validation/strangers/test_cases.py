"""Which car hides what, and that `explain` reads what is handed over."""

from collections import Counter

import numpy as np
import pytest

from hil.diagnosis.data.read import read_logs
from hil.errors import BrakebenchError
from hil.validation.strangers.brake_by_wire_van import van
from hil.validation.strangers.cases import CARS, draw, stated, write
from hil.validation.strangers.dead_time.log import RADIUS_M, another_day
from hil.validation.strangers.dead_time.log import draw as draw_of
from hil.validation.strangers.hydraulic_saloon import saloon
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


@pytest.mark.parametrize("car", CARS.values(), ids=list(CARS))
def test_another_day_has_manoeuvres_and_noise_of_its_own(car) -> None:
    first, other = car.drive(4), car.drive(4, day=5)
    assert {*first[0]} == {*other[0]}
    assert [len(log["t_s"]) for log in first] != [len(log["t_s"]) for log in other]
    assert not np.array_equal(other[0]["ax_mps2"], car.drive(5)[0]["ax_mps2"])


@pytest.mark.parametrize("car", [saloon, van], ids=lambda car: car.__name__.rsplit(".", 1)[-1])
def test_another_day_is_the_same_car(car) -> None:
    """But for single wheels: two seeds are two cars, whose masses and pads differ."""
    (own, logger), (other, logger_then), (stranger, _) = car.truth(4), car.truth(4, 5), car.truth(5)
    wheels = {"radius_m": 0.003, "gain_nm_pa": 0.03, "mu": 0.03}
    for name, value in own._asdict().items():
        then = getattr(other, name)
        if name in wheels:
            assert 0.0 < np.abs(then / value - 1.0).max() < wheels[name], name
        else:
            assert np.array_equal(then, value), name
    assert own.mass_kg != stranger.mass_kg
    assert 0.0 < abs(logger_then.ax_zero_mps2 - logger.ax_zero_mps2) < 0.05
    assert logger_then.imu_age_s != logger.imu_age_s


def test_the_wheels_of_another_day_are_this_cars_and_half_of_what_that_day_draws() -> None:
    own, day, both = draw_of(4).corners, draw_of(5).corners, another_day(4, 5).corners
    assert both.radius_m - own.radius_m == pytest.approx(0.5 * (day.radius_m - RADIUS_M))
    assert both.motor_gain - own.motor_gain == pytest.approx(0.5 * (day.motor_gain - 1.0))


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

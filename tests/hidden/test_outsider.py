"""Logs of cars nobody here modelled, told by six numbers: nothing in nothing, and a law in no list by its joint."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import one_log
import pytest
from outsider import STEP_S, VEHICLE, drive, logs

from hil.diagnosis.data.log import make_log
from hil.diagnosis.detection.result import Settings
from hil.diagnosis.explain import explain
from hil.diagnosis.vehicle.extension_file import load_extension
from plant.injection.theta import THETA


def _plain(speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
    return np.ones(4)


def _verdict_of_nothing(shared, first_seed: int) -> str:
    return shared(
        f"outsider-{first_seed}", lambda _: explain(logs(_plain, first_seed), vehicle=VEHICLE).json["verdict"]
    )


def _bump(speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
    """Pads that lose 30 % around 15 m/s."""
    return np.full(4, 1.0 - 0.3 * np.exp(-(((speed_mps - 15.0) / 3.0) ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("first_seed", [7, *(pytest.param(seed, marks=pytest.mark.long) for seed in (507, 807))])
def test_nothing_is_named_where_the_car_is_only_simpler(shared, first_seed: int) -> None:
    assert _verdict_of_nothing(shared, first_seed) == "none"


@pytest.mark.slow
@pytest.mark.long
def test_a_car_that_only_rolls_says_too_little() -> None:
    """Neither brakes nor motors act: most effects would not show, so that nothing was found is no clean bill."""
    answer = explain([drive("coast", 7, _plain)], vehicle=VEHICLE).json
    assert answer["verdict"] == "not_testable"
    assert {"pad_mu_gain", "iwm_gain"} <= set(answer["undetectable_effects"])
    assert not answer["causes"]


@pytest.mark.slow
@pytest.mark.long
def test_of_ten_draws_at_most_one_is_named(shared) -> None:
    drawn = [_verdict_of_nothing(shared, first_seed) for first_seed in (7, *range(107, 908, 100))]
    assert sum(verdict != "none" for verdict in drawn) <= 1


@pytest.mark.slow
def test_a_law_in_no_list_is_shown_with_joint_variable_and_curve(tmp_path: Path) -> None:
    found = explain(logs(_bump), vehicle=VEHICLE, out=tmp_path).json
    assert found["verdict"] == "unlisted"
    cause = found["causes"][0]
    assert (cause["effect"], cause["injection_point"], cause["variables"]) == ("unlisted", "friction.mu", ["speed"])
    curve = cause["curve"]
    lowest = min(curve, key=lambda point: point["y"])
    assert 10.0 < lowest["x"] < 20.0
    assert -0.45 < lowest["y"] < -0.12
    assert all(point["low"] <= point["y"] <= point["high"] for point in curve)
    assert len(load_extension(tmp_path / "extension.toml").nonparametric_rows) == 5


@pytest.mark.slow
@pytest.mark.long
def test_without_the_dictionary_a_listed_effect_takes_a_wrong_name() -> None:
    found = explain(logs(_bump), vehicle=VEHICLE, settings=Settings(dictionary=False)).json
    assert found["verdict"] == "named"


def _step(speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
    """Pads of the rear axle that lose 30 % above 17 m/s."""
    weaker = 1.0 - 0.3 / (1.0 + np.exp(-(speed_mps - 17.0) / 0.8))
    return np.array([1.0, 1.0, weaker, weaker])


@pytest.mark.slow
@pytest.mark.long
def test_a_listed_cause_at_its_end_gives_way_to_a_law_that_explains_more() -> None:
    """It was `mu_speed`, as steep as it may be: a straight line along a step."""
    found = explain(logs(_step), vehicle=VEHICLE).json
    assert found["verdict"] == "unlisted"
    (cause,) = found["causes"]
    assert (cause["injection_point"], cause["location"], cause["variables"]) == ("friction.mu", "rear", ["speed"])
    slow, fast = ([p["y"] for p in cause["curve"] if low < p["x"] < low + 5.0] for low in (8.0, 19.0))
    assert np.mean(slow) == pytest.approx(0.0, abs=0.12)
    assert np.mean(fast) == pytest.approx(-0.3, abs=0.12)


class _Fading:
    """Front pads that lose 0.2 % per kelvin of their disc above 470 K; discs as the plant's, told at the start."""

    def __init__(self, disc_k: float) -> None:
        self.disc_k = np.full(4, disc_k)

    def __call__(self, speed_mps: float, pressure_pa: np.ndarray) -> np.ndarray:
        share = 1.0 - np.array([2e-3, 2e-3, 0.0, 0.0]) * np.clip(self.disc_k - 470.0, 0.0, None)
        gain = np.array([VEHICLE[f"brake_gain_{axle}_nm_pa"] for axle in ("front", "front", "rear", "rear")])
        heat_w = gain * pressure_pa * share * speed_mps / VEHICLE["rolling_radius_m"]
        cooling = np.array([4.0, 4.0, 2.7, 2.7]) + np.array([0.35, 0.35, 0.23, 0.23]) * speed_mps
        capacity = np.array([3000.0, 3000.0, 2000.0, 2000.0])
        self.disc_k = self.disc_k + STEP_S * (heat_w - cooling * (self.disc_k - 293.15)) / capacity
        return share


@pytest.mark.slow
def test_a_fade_that_begins_elsewhere_has_its_name_and_says_where(tmp_path: Path) -> None:
    """It was told by its curve: shapes of listed effects were the usual ones."""
    tables = [
        replace(make_log(f"log{k}", log.pop("t_s"), log), disc_temperature_k=disc_k)
        for k, (kind, disc_k) in enumerate((("stops", 380.0), ("mixed", 440.0), ("mixed", 540.0), ("motors", 300.0)))
        for log in (drive(kind, 10 * k + 7, _Fading(disc_k)),)
    ]
    found = explain(tables, vehicle=VEHICLE, out=tmp_path).json
    assert found["verdict"] == "named"
    (cause,) = found["causes"]
    assert (cause["effect"], cause["location"]) == ("pad_temp_fade", "front")
    begins_k = load_extension(Path(found["extension"])).theta[THETA.slice("pad_temp_fade", "start_k")]
    assert begins_k == pytest.approx(cause["parameters"]["start_k"]["value"])
    assert cause["parameters"]["fade_1_k"]["value"] == pytest.approx(2e-3, rel=0.2)
    low, high = cause["parameters"]["start_k"]["ci95"]
    assert 440.0 < low < 470.0 < high < 500.0


def _rear_left_by_speed(speed_mps: float, t_s: float) -> np.ndarray:
    return np.array([1.0, 1.0, 1.0 - 0.35 * np.exp(-(((speed_mps - 15.0) / 5.0) ** 2)), 1.0])


def _weak_from_80_s(wheels: tuple[int, ...], loss: float) -> one_log.Law:
    def law(speed_mps: float, t_s: float) -> np.ndarray:
        return np.array([1.0 - loss if k in wheels and t_s > 80.0 else 1.0 for k in range(4)])

    return law


@pytest.mark.slow
def test_a_law_of_one_wheel_is_shown_from_one_csv(tmp_path: Path) -> None:
    """It was ``none``: the numbers of a car without load transfer were strained too far."""
    csv, car = one_log.write(tmp_path, _rear_left_by_speed)
    found = explain(csv, vehicle=car).json
    assert found["verdict"] == "unlisted"
    (cause,) = found["causes"]
    assert (cause["injection_point"], cause["location"], cause["variables"]) == ("friction.mu", "rl", ["speed"])
    lowest = min(cause["curve"], key=lambda point: point["y"])
    assert lowest["x"] == pytest.approx(15.0, abs=3.0)
    assert lowest["y"] == pytest.approx(-0.35, abs=0.07)


@pytest.mark.slow
@pytest.mark.long
def test_pads_of_one_wheel_that_fail_in_the_middle_of_one_log_are_told_with_wheel_and_time(tmp_path: Path) -> None:
    csv, car = one_log.write(tmp_path, _weak_from_80_s((3,), 0.3))
    found = explain(csv, vehicle=car).json
    (cause,) = found["causes"]
    told = {one["effect"]: one["onset_s"] for one in (cause, *found["rivals"])}
    assert {"pad_mu_gain", "stuck_corner"} <= set(told)
    assert told["pad_mu_gain"] == pytest.approx(80.0, abs=0.1)
    assert told["stuck_corner"] == pytest.approx(80.0, abs=0.1)
    assert cause["location"] == "rr"
    assert cause["onset_s"] == pytest.approx(80.0, abs=0.1)
    (value,) = (number["value"] for number in cause["parameters"].values())
    assert abs(value) == pytest.approx(0.3, abs=0.05)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_nothing_is_named_in_one_log_of_a_car_without_load_transfer(tmp_path: Path, seed: int) -> None:
    csv, car = one_log.write(tmp_path, lambda speed_mps, t_s: np.ones(4), seed)
    assert explain(csv, vehicle=car).json["verdict"] == "none"

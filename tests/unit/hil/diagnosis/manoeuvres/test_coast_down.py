"""Coast-downs by speed alone: the hidden road load lies in its intervals, of draws, of the plant, of every logger."""

import json
from pathlib import Path

import numpy as np
import plant_logs
import pytest

from hil.cli.main import main
from hil.diagnosis.data.log import WHEEL_SPEED, UnusableError, make_log
from hil.diagnosis.explain import explain
from hil.diagnosis.manoeuvres.coast_down import CoastDown, coast_down
from hil.diagnosis.manoeuvres.coast_down_page import build_report
from hil.diagnosis.manoeuvres.coasting import CELL_S, RoadLoad, Run, coast_downs, stated_road_load
from hil.diagnosis.manoeuvres.road_load import fit
from hil.diagnosis.sensor_consistency.check import Consistency
from hil.diagnosis.vehicle.load import load_vehicle, paper_car
from hil.report.html import write_html
from plant.injection.theta import THETA
from plant.vectors import INPUT

CAR = {
    "mass_kg": 1500.0, "mass_kg_tolerance": 0.0, "wheelbase_m": 2.7, "cog_to_front_axle_m": 1.3,
    "rolling_radius_m": 0.31, "wheel_inertia_kg_m2": 1.2, "wheel_inertia_kg_m2_tolerance": 0.0,
    "brake_gain_front_nm_pa": 2.5e-4, "brake_gain_rear_nm_pa": 1.2e-4, "rolling_resistance": 0.0125,
    "rolling_resistance_tolerance": 0.001, "drag_coefficient": 0.31, "drag_coefficient_tolerance": 0.015,
    "frontal_area_m2": 2.1, "air_density_kg_m3": 1.2, "lift_front": 0.0, "lift_rear": 0.0,
}  # fmt: skip
STATED = RoadLoad(0.1, 3e-4, 1550.0)
A, B, STEP_S = 0.12, 2.6e-4, 0.05
TRUE = np.array([A, B])


def speeds(seed: int, directions, slow=0.02, time_s=8.0, white=0.03, grade=0.03, wind=1.5, a=A, b=B, length_s=70.0):
    """Speeds of coast-downs from 33 m/s, each (samples,), with gusts of a time constant, slope, wind and noise."""
    rng, keep, count = np.random.default_rng(seed), np.exp(-STEP_S / time_s), round(length_s / STEP_S)
    for direction in directions:
        v, gust, out = 33.0 + rng.normal(0.0, 0.5), slow * rng.standard_normal(), np.empty(count)
        shocks = slow * np.sqrt(1.0 - keep**2) * rng.standard_normal(count)
        for k in range(count):
            out[k] = v
            v -= STEP_S * (a + direction * grade + b * (v + direction * wind) ** 2 - gust)
            gust = keep * gust + shocks[k]
        yield out + white * rng.standard_normal(count)


def runs(seed: int, directions=(1, -1) * 4, **true) -> list[Run]:
    size = round(CELL_S / STEP_S)
    made = zip(directions, speeds(seed, directions, **true), strict=True)
    return [Run("made", 0.0, d, v[: len(v) // size * size].reshape(-1, size).mean(axis=1)) for d, v in made]


def coverage(draws: int, **true) -> tuple[np.ndarray, np.ndarray]:
    """Share of draws whose intervals hold a and b, and mean error in standard deviations."""
    errors, inside = [], []
    for seed in range(draws):
        found = fit(runs(seed + 1000, **true), STATED)
        sd = np.sqrt(np.diag(found.covariance)[:2])
        errors.append((found.x[:2] - TRUE) / sd)
        inside.append(np.abs(errors[-1]) < found.quantile)
    return np.mean(inside, axis=0), np.mean(errors, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("true", [{}, {"time_s": 20.0, "slow": 0.01}], ids=["gusts", "drifts"])
def test_intervals_hold_the_truth_in_95_of_100_draws(true: dict[str, float]) -> None:
    """Of 200 draws 92 to 98 %: 1.5 % is the standard deviation of such a count."""
    inside, error = coverage(200, **true)
    assert (inside >= 0.92).all(), inside
    assert (inside <= 0.98).all(), inside
    assert (np.abs(error) < 0.25).all(), "as many above as below"


def test_both_directions_tell_slope_and_wind_from_rolling_resistance_and_drag() -> None:
    hilly = {"grade": 0.06, "wind": 4.0, "slow": 0.005}
    both, one = (fit(runs(3, directions, **hilly), STATED) for directions in ((1, -1) * 3, (1,) * 6))
    assert both.x[:4] == pytest.approx([A, B, 0.06, 4.0], rel=0.15)
    sd = [np.sqrt(np.diag(found.covariance)[:2]) for found in (both, one)]
    assert (sd[1] > 2.0 * sd[0]).all()
    assert (np.abs(one.x[:2] - TRUE) < 3.0 * one.quantile * sd[1]).all()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four coast-downs as CSV, with their directions, and the car."""
    directions = (1, -1) * 2
    true = {"a": 0.0125 * 9.80665 * 1500.0 / EFFECTIVE_KG, "b": 0.5 * 1.2 * 0.31 * 2.1 / EFFECTIVE_KG}
    for k, v in enumerate(speeds(8, directions, slow=0.01, **true)):
        t = STEP_S * np.arange(len(v))
        table = np.column_stack((t, v))
        np.savetxt(tmp_path / f"c{k}.csv", table, "%.4f", ",", header="t_s,speed_mps", comments="")
    about = "".join(f'["c{k}.csv"]\ndirection = {d}\n' for k, d in enumerate(directions))
    (tmp_path / "logs.toml").write_text(about)
    (tmp_path / "car.toml").write_text("\n".join(f"{key} = {value}" for key, value in CAR.items()))
    return tmp_path


EFFECTIVE_KG = 1500.0 + 4.0 * 1.2 / 0.31**2


def test_the_command_gives_the_road_load_of_a_speed_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["explain", str(folder), "--vehicle", str(folder / "car.toml")]
    assert main([*command, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "none"
    found = answer["coast_down"]["estimates"]
    for name, truth in (("rolling_resistance", 0.0125), ("drag_area", 0.651), ("f0", 183.9), ("f2", 0.3906)):
        low, high = found[name]["ci95"]
        assert low < truth < high, name
        assert high - low < 0.4 * truth
        assert found[name]["stated"] == pytest.approx(truth, rel=3e-3)
    assert [one["direction"] for one in answer["coast_down"]["runs"]] == [1, -1] * 2
    error = answer["held_out_error"]["speed_in_coast_downs"]
    assert error["after"] < error["before"]
    assert "J1263" in answer["coast_down"]["method"]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "Road load over speed" in printed
    assert "rolling resistance" in printed


@pytest.mark.slow
def test_a_car_that_rolls_harder_is_not_as_stated(folder: Path) -> None:
    car = CAR | {"rolling_resistance": 0.007, "rolling_resistance_tolerance": 0.0005}
    answer = explain(folder, car, out=folder / "out")
    assert isinstance(answer, CoastDown)
    write_html(build_report(answer, ["c0.csv"]), folder / "report.html")
    assert "Road load over speed" in (folder / "report.html").read_text()
    assert answer.json["verdict"] == "cannot_tell_apart"
    (cause,) = answer.json["causes"]
    low, high = cause["parameters"]["gain"]["ci95"]
    assert cause["effect"] == "rolling_resistance"
    assert low < 0.0125 / 0.007 - 1.0 < high
    assert [rival["effect"] for rival in answer.json["rivals"]] == ["residual_drag"]
    again = explain(folder, car, extend=folder / "out" / "extension.toml")
    assert again.json["verdict"] == "none"
    blunt = explain(folder, CAR | {"drag_coefficient": 0.2}).json
    assert (blunt["verdict"], [cause["effect"] for cause in blunt["causes"]]) == ("unlisted", ["unlisted"])


@pytest.mark.parametrize("channels", ["speed_mps", "wheels"])
def test_the_plants_own_road_load_is_found(channels: str) -> None:
    """Coasting at 100 Hz with sensor noise, a coloured force, and the shipped set's own numbers as the truth."""

    def none(count: int, _: int) -> np.ndarray:
        return np.zeros((count, INPUT.size))

    names = ("speed_mps",) if channels == "speed_mps" else WHEEL_SPEED
    logs = []
    for k in range(4):
        table = plant_logs.log(THETA.neutral(), 2, k, 40.0, none, 34.0 - 6.0 * k)
        logs.append(make_log(f"c{k}", table["t_s"], {name: table[name] for name in names}))
    answer = coast_down(logs, paper_car())
    assert answer is not None
    truth = stated_road_load(paper_car())
    for name, value in (("f0", truth.a_mps2), ("f2", truth.b_1_m)):
        low, high = answer.json["coast_down"]["estimates"][name]["ci95"]
        assert low < value * truth.effective_kg < high, name
    assert answer.json["verdict"] == "none"
    assert any("one direction" in text for text in answer.json["remarks"])


def test_the_stated_road_load_is_the_plants() -> None:
    """Without noise the plant coasts as f0 + f2 v^2 of its own set says."""
    count = 6000
    _, (speed, _) = plant_logs.log(
        THETA.neutral(), 1, 0, 60.0, lambda n, _: np.zeros((n, INPUT.size)), 33.0, exact=True
    )
    load, v = stated_road_load(paper_car()), float(speed[100])
    for k in range(101, count):
        middle = v - 0.005 * (load.a_mps2 + load.b_1_m * v**2)
        v -= 0.01 * (load.a_mps2 + load.b_1_m * middle**2)
        assert v == pytest.approx(float(speed[k]), abs=0.03)


@pytest.mark.parametrize("rate_hz", [10.0, 20.0])
def test_coasting_is_found_between_pulling_and_braking(rate_hz: float) -> None:
    """20 s of pulling, 40 s of coasting and 8 s of braking: the coast-down alone, less 2 s at either end."""
    car, v, speed = load_vehicle(CAR), 15.0, []
    load = stated_road_load(car)
    for k in range(round(68.0 * rate_hz)):
        t = k / rate_hz
        speed.append(v)
        accel = 0.9 if t < 20.0 else -(load.a_mps2 + load.b_1_m * v * v) if t < 60.0 else -3.0
        v = max(v + accel / rate_hz, 0.0)
    log = make_log("drive", np.arange(len(speed)) / rate_hz, {"speed_mps": np.array(speed)})
    (run,) = coast_downs([log], car)
    assert run.begin_s == pytest.approx(22.0, abs=1.6)
    assert run.begin_s + run.length_s == pytest.approx(58.0, abs=1.6)
    pulled = make_log("pulled", log.t_s, {"speed_mps": np.array(speed), "throttle": np.full(len(speed), 0.2)})
    assert coast_downs([pulled], car) == []


def test_what_does_not_coast_is_refused_as_before_and_sensors_keep_their_own_page() -> None:
    t = np.arange(0.0, 60.0, 0.05)
    with pytest.raises(UnusableError, match="what braked the car; a speed alone serves where the car mostly coasts"):
        explain({"t_s": t, "speed_mps": 20.0 + 5.0 * np.sin(0.3 * t)}, CAR)
    assert (
        coast_downs([make_log("a", t, {"speed_mps": 20.0 - 0.2 * t, "pressure_fl_pa": 0.0 * t})], load_vehicle(CAR))
        == []
    )


@pytest.mark.slow
def test_with_an_accelerometer_the_road_load_is_told_beside_the_sensors() -> None:
    logs = []
    for k, v in enumerate(speeds(5, (1, 1), grade=0.0, wind=0.0, length_s=20.0)):
        t = STEP_S * np.arange(len(v))
        ax = -(A + B * v**2) + 0.05 * np.random.default_rng(k).standard_normal(len(v))
        logs.append(make_log(f"c{k}", t, {"speed_mps": v, "ax_mps2": ax}))
    answer = explain(logs, CAR)
    assert isinstance(answer, Consistency)
    assert answer.json["coast_down"]["estimates"]["f0"]["value"] > 0.0

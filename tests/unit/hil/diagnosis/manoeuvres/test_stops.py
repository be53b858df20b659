"""Mean fully developed deceleration: numbers by hand, ramps, and stops of the plant with their exact truth."""

import json

import numpy as np
import plant_logs
import pytest

from hil.braking import crossings, distance, mean_fully_developed_deceleration
from hil.cli.main import main
from hil.diagnosis.data.log import PRESSURE, WHEEL_SPEED, Log, make_log
from hil.diagnosis.data.read import from_frame
from hil.diagnosis.manoeuvres.stops import section, stops_of
from plant.injection.theta import THETA
from plant.vectors import INPUT

RADIUS_M = 0.308


def test_the_formula_by_hand() -> None:
    """From 100 km/h: vb 80, ve 10 km/h; 6400 - 100 = 6300; over 38.2 - 7.1 = 31.1 m: 6300 / 806.112 = 7.8153."""
    assert mean_fully_developed_deceleration(100.0 / 3.6, 7.1, 38.2) == pytest.approx(7.8153, abs=1e-4)
    with pytest.raises(ValueError, match="expected se beyond sb"):
        mean_fully_developed_deceleration(20.0, 5.0, 5.0)


def test_a_constant_deceleration_is_its_own_mean() -> None:
    t = np.linspace(0.0, 3.0, 31)
    speed = 20.0 - 8.0 * t
    times = crossings(t, speed, 0.0, (16.0, 2.0))
    assert times == pytest.approx([0.5, 2.25])
    upper, lower = (distance(t, speed, 0.0, time) for time in times)
    assert (upper, lower) == pytest.approx((9.0, 24.75), abs=1e-2)
    assert mean_fully_developed_deceleration(20.0, upper, lower) == pytest.approx(8.0, rel=1e-3)
    assert crossings(t, speed + 10.0, 0.0, (24.0, 3.0)) is None


def ramp(rate_hz: float, noise: float = 0.0, ground: bool = True, end_mps: float = 0.0, pressure: bool = True) -> Log:
    """1 s at 25 m/s, then 6 m/s2 to ``end_mps``, then 1 s on at that speed."""
    t = np.arange(0.0, 2.0 + (25.0 - end_mps) / 6.0, 1.0 / rate_hz)
    speed = np.clip(25.0 - 6.0 * np.maximum(t - 1.0, 0.0), end_mps, None)
    noisy = speed + noise * np.random.default_rng(3).standard_normal(len(t))
    channels = {"speed_mps": noisy} if ground else dict.fromkeys(WHEEL_SPEED, noisy / RADIUS_M)
    if pressure:
        applied = np.where((t > 1.0) & (speed > end_mps), 5e6, 0.0)
        channels |= {name: applied * share for name, share in zip(PRESSURE, (1.0, 1.0, 0.5, 0.5), strict=True)}
    return make_log("ramp.csv", t, channels)


@pytest.mark.parametrize("pressure", [True, False])
@pytest.mark.parametrize("ground", [True, False])
@pytest.mark.parametrize(("rate_hz", "noise", "within"), [
    (200.0, 0.05, 0.01), (100.0, 0.05, 0.01), (50.0, 0.0, 0.004), (20.0, 0.05, 0.01), (10.0, 0.0, 0.01),
])  # fmt: skip
def test_a_ramp_has_its_figures(rate_hz, noise, within, ground, pressure):
    (stop,) = stops_of([ramp(rate_hz, noise, ground, pressure=pressure)], RADIUS_M)
    assert stop.mfdd_mps2 == pytest.approx(6.0, rel=within)
    assert stop.v0_mps == pytest.approx(25.0, rel=within)
    assert stop.distance_m == pytest.approx(25.0**2 / 12.0, rel=0.02)
    assert stop.begin_s == pytest.approx(1.0, abs=0.15)
    assert stop.duration_s == pytest.approx(25.0 / 6.0, abs=0.2)
    assert stop.speed == ("ground" if ground else "wheels")
    assert stop.peak_mps2 == pytest.approx(6.0, rel=0.01 + 4.0 * noise)
    if pressure:
        assert (stop.pressure_pa, stop.peak_pressure_pa) == pytest.approx((3.75e6, 5e6))
    else:
        assert (stop.pressure_pa, stop.peak_pressure_pa) == (None, None)


def test_a_braking_that_does_not_reach_a_tenth_is_no_stop() -> None:
    assert stops_of([ramp(100.0, end_mps=5.0)], RADIUS_M) == []
    assert stops_of([make_log("a", np.arange(500) * 0.01, {"speed_mps": np.full(500, 20.0)})], RADIUS_M) == []
    assert stops_of([make_log("a", np.arange(500) * 0.01, {"ax_mps2": np.zeros(500)})], RADIUS_M) == []


def test_a_log_may_hold_several_stops_and_begin_within_one() -> None:
    one = ramp(100.0)
    t, speed = one.t_s, one.channels["speed_mps"]
    again = np.concatenate((speed[150:], np.linspace(0.0, 25.0, 1000), speed))
    stops = stops_of([make_log("two", np.arange(len(again)) * (t[1] - t[0]), {"speed_mps": again})], RADIUS_M)
    assert [stop.v0_mps for stop in stops] == pytest.approx([22.0, 25.0], rel=0.01)
    assert [stop.mfdd_mps2 for stop in stops] == pytest.approx([6.0, 6.0], rel=0.01)


@pytest.mark.parametrize("demand_pa", [3e6, 7e6])
def test_a_stop_of_the_plant_has_the_deceleration_of_its_exact_truth(demand_pa: float) -> None:
    """The truth from the plant's own distance and speed without noise."""

    def demands(n: int, _: int) -> np.ndarray:
        u = np.zeros((n, INPUT.size))
        u[:, INPUT.slice("pressure_demand_pa")] = np.where(np.arange(n) > 100, demand_pa, 0.0)[:, None]
        return u

    columns, exact = plant_logs.log(THETA.neutral(), 4, 0, 14.0, demands, 22.0, exact=True)
    (stop,) = stops_of([from_frame(columns)], RADIUS_M)
    speed, way = exact
    begin = 101
    upper, lower = (int(np.argmax(speed < share * speed[begin])) for share in (0.8, 0.1))
    truth = (speed[upper] ** 2 - speed[lower] ** 2) / (2.0 * (way[lower] - way[upper]))
    assert stop.mfdd_mps2 == pytest.approx(truth, rel=0.01)
    still = int(np.argmax(speed < 0.05))
    assert stop.distance_m == pytest.approx(way[still] - way[begin], rel=0.02)
    assert stop.begin_s == pytest.approx(1.01, abs=0.05)


def test_the_section_shows_what_the_json_holds() -> None:
    (stop,) = stops_of([ramp(100.0)], RADIUS_M)
    (shown,) = section([stop.as_json()])
    (table,) = shown.tables
    assert table.rows[0][0] == "ramp.csv"
    assert table.rows[0][2:4] == (90.0, pytest.approx(6.0, abs=0.03))
    assert section([]) == ()


def test_stops_of_which_the_speed_alone_is_known_have_their_figures(tmp_path, capsys):
    log = ramp(50.0, pressure=False)
    np.savetxt(
        tmp_path / "stop.csv", np.column_stack((log.t_s, log.channels["speed_mps"])), "%.5f", ",",
        header="t_s,speed_mps", comments="",
    )  # fmt: skip
    assert main(["explain", str(tmp_path / "stop.csv"), "--vehicle", "paper_car", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "not_testable"
    assert [one["mfdd_mps2"] for one in answer["stops"]] == pytest.approx([6.0], rel=0.01)
    assert main(["explain", str(tmp_path / "stop.csv"), "--vehicle", "paper_car", "--out", str(tmp_path / "out")]) == 0
    assert "MFDD" in capsys.readouterr().out
    assert "Stops" in (tmp_path / "out" / "report.html").read_text()

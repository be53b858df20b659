"""Figures of a channel measured and simulated, on tracks whose lag, bias and noise are known."""

import numpy as np
import pytest

from hil.diagnosis.data.prepare import prepare
from hil.diagnosis.data.read import from_frame
from hil.diagnosis.foreign_plant.compare import compare, paired
from hil.diagnosis.foreign_plant.replay import compared
from hil.fmu.plant_map import load_plant_map

RADIUS_M = 0.3
NOISE_MPS = 0.02


@pytest.fixture(scope="module")
def dataset():
    """20 s at changing speed, with noise of 0.02 m/s on every wheel; brakes from 12 s on."""
    random, t_s = np.random.default_rng(1), 0.01 * np.arange(2000)
    speed = 15.0 + 2.0 * np.sin(t_s) - np.clip(t_s - 12.0, 0.0, None)
    wheel = {f"wheel_speed_{w}_rad_s": (speed + NOISE_MPS * random.normal(size=2000)) / RADIUS_M for w in WHEELS}
    brake = {f"pressure_demand_{w}_pa": np.where(t_s > 12.0, 1e6, 0.0) for w in WHEELS}
    return prepare([from_frame({"t_s": t_s} | wheel | brake, "drive")], RADIUS_M)


WHEELS = ("fl", "fr", "rl", "rr")


def simulated(dataset, change):
    """Wheel speeds without noise, later, or off."""
    t_s = 0.005 + dataset.sample_s * np.arange(dataset.recordings[0].samples)
    speed = 15.0 + 2.0 * np.sin(t_s) - np.clip(t_s - 12.0, 0.0, None)
    return {"wheel_speed_fl_rad_s": change(t_s, speed) / RADIUS_M}


def of(dataset, change):
    (found,) = compare(paired(simulated(dataset, change), dataset, RADIUS_M), dataset)
    return found


def test_what_is_right_leaves_white_noise(dataset):
    found = of(dataset, lambda _, speed: speed)
    averaged = NOISE_MPS / 2**0.5  # a sample is the mean of two rows
    assert found.noise == pytest.approx(averaged, rel=0.15)
    assert found.over_noise == pytest.approx(1.0, abs=0.15)
    assert abs(found.bias) < 0.003
    assert abs(found.lag_s) < 0.002
    assert found.explained > 0.999
    assert abs(found.autocorrelation) < 0.15
    assert found.whiteness_p > 0.001
    assert found.unit == "m/s"


def test_a_bias_a_lag_and_a_place_are_told(dataset):
    found = of(dataset, lambda _, speed: speed - 0.5)
    assert found.bias == pytest.approx(0.5, abs=0.003)
    assert found.over_noise > 20.0
    late = of(dataset, lambda t_s, speed: np.interp(t_s + 0.1, t_s, speed))
    assert late.lag_s == pytest.approx(0.1, abs=0.005)
    worse = of(dataset, lambda t_s, speed: speed + np.where(t_s > 12.5, 0.3, 0.0))
    assert worse.worst_context == "braking by friction"
    assert set(worse.contexts) == {"braking by friction", "rolling"}
    assert worse.contexts["rolling"] < 0.1 < worse.contexts["braking by friction"]
    assert worse.worst_log == "drive"
    assert 12.0 < worse.worst_s[0] < 20.0
    assert worse.autocorrelation > 0.9
    assert worse.whiteness_p < 1e-6


def test_what_is_unknown_is_not_compared(dataset):
    found = of(dataset, lambda t_s, speed: np.where(t_s < 5.0, np.nan, speed))
    assert found.samples == pytest.approx(15.0 / dataset.sample_s, rel=0.02)
    assert not paired(simulated(dataset, lambda t_s, _: np.full(len(t_s), np.inf)), dataset, RADIUS_M)


def test_a_map_names_what_is_compared(dataset, tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(
        'start_speed = { fmu = "v0_kmh", factor = 3.6 }\n[outputs]\n"TRUTH_MOTION.SPEED" = "v"\n'
        '"WHEEL_SPEED_FRONT.WHEEL_SPEED_FL" = { fmu = "v", factor = 3.0, offset = 1.0 }\n'
        '"WHEEL_SPEED_FRONT.WHEEL_SPEED_FR" = { value = 1.0 }\n'
    )
    chart = load_plant_map(path)
    assert chart.parameters_at(10.0) == {"v0_kmh": 36.0}
    sources = compared(chart, dataset)
    assert list(sources) == ["wheel_speed_fl_rad_s"]  # fr is no number of the FMU, and no ground speed is measured
    speed = np.array([0.0, 2.0])
    assert sources["wheel_speed_fl_rad_s"].value({"v": speed}, {}, np.ones(2)).tolist() == [1.0, 7.0]

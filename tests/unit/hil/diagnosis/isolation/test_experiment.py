"""What to drive next: which scenario tells a tied set apart, and that it runs."""

import json

import pytest

from hil.bench.result import measure
from hil.bench.virtual import simulate
from hil.diagnosis.detection.threshold import ISOLABILITY_SIGMA
from hil.diagnosis.isolation.experiment import (
    FOLDER,
    MAX_RECOMMENDATIONS,
    STRAIGHT_STOP,
    discriminating_manoeuvres,
    separation,
    write,
)
from hil.errors import BrakebenchError
from hil.scenario.scenario import load_scenario, scenario_names

pytestmark = pytest.mark.slow
TIED = [
    ("mass_offset", "pad_mu_gain", "headwind", "rolling_resistance"),
    ("mass_offset@car", "pad_mu_gain@front", "pad_mu_gain@rear", "headwind.drag_gain@car"),
    ("road_grade", "imu_bias"),
    ("pressure_offset", "pad_mu_gain"),
    ("tyre_radius", "wrong_scale"),
    ("tyre_radius", "speed_scale"),
    ("pad_mu_gain@fr", "caliper_asymmetry@fr"),
]


@pytest.mark.parametrize("effects", TIED, ids=lambda effects: effects[0] + "+" + effects[1])
def test_what_is_recommended_separates_better_than_a_straight_stop(effects):
    advice = discriminating_manoeuvres(effects)
    assert 1 <= len(advice) <= MAX_RECOMMENDATIONS
    assert [a.separation for a in advice] == sorted((a.separation for a in advice), reverse=True)
    best = advice[0]
    print(effects, [(a.scenario, round(a.separation, 1)) for a in advice], round(best.straight_stop, 1))
    assert best.straight_stop == pytest.approx(separation(STRAIGHT_STOP, effects))
    assert best.separation == pytest.approx(separation(best.scenario, effects))
    assert best.separation > 2.0 * best.straight_stop
    assert all(a.separation >= ISOLABILITY_SIGMA for a in advice)


def test_straight_stops_leave_mass_pads_wind_and_rolling_tied():
    assert separation(STRAIGHT_STOP, TIED[0]) < ISOLABILITY_SIGMA


def test_motors_alone_do_not_show_the_pads_and_are_not_recommended():
    effects = ("mass_offset", "pad_mu_gain")
    assert separation("motor_chirp", effects) < 0.5
    assert "motor_chirp" not in [a.scenario for a in discriminating_manoeuvres(effects, most=99)]


def test_what_the_road_does_is_driven_out_and_back():
    assert discriminating_manoeuvres(("road_grade", "imu_bias"))[0].both_ways
    assert "back" in discriminating_manoeuvres(("road_grade", "imu_bias"))[0].why
    assert not discriminating_manoeuvres(("pressure_offset", "pad_mu_gain"))[0].both_ways


def test_what_the_leading_end_of_a_pad_does_is_seen_in_reverse():
    assert [a.scenario for a in discriminating_manoeuvres(("pad_mu_gain@fr", "caliper_asymmetry@fr"))] == [
        "decide_reverse_and_forward"
    ]


def test_an_effect_with_several_numbers_counts_by_the_one_in_doubt():
    """A slope is no yaw rate: what has to be told from it is the zero of the longitudinal accelerometer."""
    by_name = separation(STRAIGHT_STOP, ("road_grade", "imu_bias"))
    assert by_name == pytest.approx(separation(STRAIGHT_STOP, ("road_grade", "imu_bias.ax_mps2@car")))


def test_what_no_scenario_tells_apart_gets_no_advice():
    assert discriminating_manoeuvres(("wheel_speed_lowv", "low_speed")) == []


def test_the_same_is_said_again():
    assert discriminating_manoeuvres(TIED[2]) == discriminating_manoeuvres(TIED[2])


def test_what_is_written_runs(tmp_path):
    """The file as `brakebench run` takes it, in virtual time, in closed loop with the controller."""
    advice = discriminating_manoeuvres(TIED[0])
    paths = write(advice, tmp_path)
    assert [path.parent for path in paths] == [tmp_path / FOLDER] * len(advice)
    scenario = load_scenario(str(paths[0]))
    assert scenario.sha256 == load_scenario(advice[0].scenario).sha256
    result = measure(simulate(scenario))
    assert result.frames_lost == 0
    entry = advice[0].as_json(paths[0])
    assert json.loads(json.dumps(entry)) == entry
    assert entry["scenario"] == str(paths[0])
    assert set(entry) == {"scenario", "why", "separation"}
    assert advice[0].as_json()["scenario"] in scenario_names()


def test_no_advice_writes_nothing(tmp_path):
    assert write([], tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def test_a_name_nobody_knows_is_refused_with_near_ones():
    with pytest.raises(BrakebenchError, match="mass_offset"):
        discriminating_manoeuvres(("mass_offst", "pad_mu_gain"))


@pytest.mark.parametrize("effects", [(), ("mass_offset",), ("pad_mu_gain@front", "pad_mu_gain@rear")])
def test_there_must_be_something_to_tell_apart(effects):
    with pytest.raises(BrakebenchError, match="two effects or more"):
        discriminating_manoeuvres(effects)

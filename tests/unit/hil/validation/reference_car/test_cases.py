import json
import tomllib

import numpy as np
import pyarrow.parquet
import pytest

from hil.cli.main import main
from hil.errors import BrakebenchError
from hil.validation.reference_car.car import NOMINAL
from hil.validation.reference_car.case import (
    NUMBERS,
    Hidden,
    _signatures,
    as_number,
    expected_snr,
    logs,
    make_case,
    scaled_case,
)
from hil.validation.reference_car.cases import FAMILIES, answer, draw, followed_by, read_answer, write
from hil.validation.reference_car.catalogue import HIDEABLE, LISTED, TWINS, find
from hil.validation.reference_car.drive import drive
from hil.validation.reference_car.files import sealed_folder, vehicle_toml
from hil.validation.reference_car.manoeuvres import SETS
from hil.validation.reference_car.noise import USUALLY_LATE_S
from hil.validation.reference_car.strengths import ROWS, E

GAIN = Hidden("pad_mu_gain", "front", -0.1)


def test_forty_listed_effects_and_more():
    assert len(LISTED) >= 60
    assert len({kind.name for kind in LISTED}) == len(LISTED)
    for kind in HIDEABLE.values():
        assert kind.low <= kind.typical <= kind.high
        assert kind.typical != 0.0
        assert kind.strength(kind.typical, kind.where[0]).any()
    for pair in TWINS:
        assert all(name in HIDEABLE for name in pair)


@pytest.mark.parametrize(
    ("hidden", "options", "says"),
    [
        ((Hidden("nonsense", "car", 1.0),), {}, "nothing of that name"),
        ((Hidden("pad_mu_gain", "imu", 0.1),), {}, "acts on"),
        ((Hidden("pad_mu_gain", "fl", 9.0),), {}, "lies between"),
        ((), {"noise_level": "loud"}, "--noise"),
        ((), {"manoeuvres": "moon"}, "--manoeuvres"),
        ((Hidden("unlisted_cubic_mu", "fl", 0.1), Hidden("unlisted_step_drag", "car", 50.0)), {}, "two laws"),
    ],
)
def test_impossible_cases_are_refused(hidden, options, says):
    with pytest.raises(BrakebenchError, match=says):
        make_case(hidden, 1, **options)


def test_a_folder_holds_what_an_engineer_hands_over_and_nothing_more(tmp_path):
    case = make_case((GAIN,), 3, "low", "stops")
    path = write(case, tmp_path / "hidden")
    assert path == tmp_path / "hidden.sealed" / "answer.json"
    names = {file.name for file in (tmp_path / "hidden").iterdir()}
    assert names == {"logs.toml", "vehicle.toml"} | {f"{drive.name}.parquet" for drive in case.drives}
    described = tomllib.loads((tmp_path / "hidden" / "logs.toml").read_text())
    assert described["stop_72_b.parquet"] == {"direction": -1, "initial_disc_temperature_k": 380.0}
    told = (tmp_path / "hidden" / "vehicle.toml").read_text()
    assert "pad_mu_gain" not in told
    assert repr(float(case.car.mass_kg)) not in told
    table = pyarrow.parquet.read_table(tmp_path / "hidden" / "stop_72_a.parquet")
    assert {"t_s", "wheel_speed_fl_rad_s", "pressure_demand_rr_pa", "motor_torque_rl_nm", "steer_rad"} <= set(
        table.column_names
    )
    opened = read_answer(tmp_path / "hidden")
    assert opened == json.loads(json.dumps(answer(case)))
    assert opened["verdict"] == "named"
    assert opened["causes"][0]["parameters"] == {"gain": {"value": -0.1, "unit": ""}}
    with pytest.raises(BrakebenchError, match="not empty"):
        write(case, tmp_path / "hidden")


def test_onset_is_told_by_log_and_time():
    case = make_case((Hidden("imu_bias", "car", 0.1, 12.0),), 3, "low", "stops")
    cause = answer(case)["causes"][0]
    assert cause["onset"] == {"log": "stop_72_b.parquet", "t_s": 4.0}
    assert cause["onset_s"] == 12.0


def test_the_car_as_told_has_a_tolerance_for_every_number():
    told = tomllib.loads(vehicle_toml())
    for key in [key for key in told if not key.endswith("_tolerance")]:
        assert f"{key}_tolerance" in told
    assert told["mass_kg"] == 1463.0
    assert (told["lift_rear"], told["lift_rear_tolerance"]) == (0.08, 0.03)
    assert told["tyre_lkx_tolerance"] == pytest.approx(0.0987, abs=1e-3)


def test_logs_repeat_themselves():
    case = make_case((GAIN,), 5, "high", "stops")
    for one, other in zip(logs(case), logs(case), strict=True):
        for name in one:
            np.testing.assert_array_equal(one[name], other[name])


@pytest.mark.slow
def test_magnitude_is_scaled_for_the_snr():
    case = make_case((Hidden("tyre_radius", "fl", -0.008),), 5, "medium", "stops")
    for target in (5.0, 15.0):
        scaled = scaled_case(case, target)
        assert scaled.reached
        assert expected_snr(scaled)[0] == pytest.approx(target, rel=0.05)
    assert expected_snr(scaled)[1] >= expected_snr(scaled)[0]


@pytest.mark.slow
def test_a_bound_ends_the_search():
    scaled = scaled_case(make_case((Hidden("pad_temp_fade", "car", 0.0001),), 5, "high", "stops"), 1000.0)
    assert not scaled.reached
    assert scaled.hidden[0].magnitude <= find("pad_temp_fade").high


def test_what_tolerances_imitate_counts_less():
    mass = make_case((Hidden("mass_offset", "car", 10.0),), 5, "medium", "stops")
    beside, alone = expected_snr(mass)
    assert beside < 2.5
    assert alone > 2.0 * beside


@pytest.mark.slow
def test_how_late_a_node_sends_is_a_tolerance_too():
    """A lag of the pressure's sensor is a latency as long as it is short."""
    late = make_case((Hidden("timestamp_offset", "imu", 0.001),), 5, "low", "stops")
    assert expected_snr(late)[0] <= 0.001 / USUALLY_LATE_S < 2.2 < expected_snr(late)[1]
    lag = make_case((Hidden("pressure_location", "car", 0.001),), 5, "low", "stops")
    beside, alone = expected_snr(lag)
    assert beside < 3.0 < alone


def test_families_draw_the_same_again():
    assert draw("null", 4, 1) == draw("null", 4, 1)
    assert draw("null", 4, 1) != draw("null", 5, 1)
    assert draw("null", 4, 1).hidden == ()
    tied = draw("confounded", 1, 1)
    assert tied.manoeuvres == "stops"
    assert followed_by(tied).manoeuvres == "decide"
    assert followed_by(tied).hidden == tied.hidden
    with pytest.raises(BrakebenchError, match="family"):
        draw("nothing", 0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_can_be_drawn(family, monkeypatch):
    """On the four stops instead of the whole set, for speed."""
    monkeypatch.setitem(SETS, "full", SETS["stops"])
    case = draw(family, 1, 2)
    _signatures.cache_clear()
    assert case.family == family
    assert answer(case)["verdict"] in ("none", "named", "unlisted")
    assert (case.hidden == ()) == (family == "null")


def test_command_line(tmp_path, capsys):
    arguments = ["hide", "--effect", "none", "--manoeuvres", "cold", "--out", str(tmp_path / "one"), "--json"]
    assert main(arguments) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["count"] == 7
    assert sealed_folder(tmp_path / "one").is_dir()
    assert main(["hide", "--effect", "list"]) == 0
    assert "pad_mu_gain" in capsys.readouterr().out
    assert main(["hide", "--effect", "none"]) == 2
    assert main(["hide", "--effect", "none", "--snr", "3", "--out", str(tmp_path / "two")]) == 2
    assert "leave them out" in capsys.readouterr().err


def test_what_a_number_of_the_car_is_stands_out_no_more_than_its_tolerance_says():
    """Off by as many standard deviations as are hidden, the number imitates it exactly."""
    mass = make_case((Hidden("mass_offset", "car", 75.0),), 3, "low", "stops")
    assert as_number(mass) == pytest.approx(10.0)
    assert expected_snr(mass)[0] <= 10.0 < expected_snr(mass)[1]
    assert as_number(make_case((Hidden("slip_stiffness", "car", -0.25),), 3)) == pytest.approx(0.25 * 22.3 / 1.1)
    assert as_number(make_case((Hidden("slip_stiffness", "front", -0.25),), 3)) == np.inf
    assert as_number(make_case((Hidden("mass_offset", "car", 75.0, 12.0),), 3)) == np.inf
    assert as_number(make_case((GAIN,), 3)) == np.inf


@pytest.mark.parametrize("effect", sorted(NUMBERS))
def test_a_number_off_by_as_much_drives_as_the_effect_does(effect):
    kind, (name, of_nominal) = find(effect), NUMBERS[effect]
    size = 0.2 * kind.typical
    case = make_case((Hidden(effect, "car", size),), 3, "low", "stops")
    number = getattr(NOMINAL, name) + size * (getattr(NOMINAL, name) if of_nominal else 1.0)
    manoeuvre, quiet = case.drives[0], np.zeros((case.drives[0].ticks, 2))
    strength = np.zeros((ROWS, 4))
    strength[getattr(E, effect)] = kind.strength(size, "car")
    as_effect = drive(manoeuvre, NOMINAL, strength, np.zeros(ROWS), 0, quiet)
    as_a_number = drive(manoeuvre, NOMINAL._replace(**{name: number}), np.zeros((ROWS, 4)), np.zeros(ROWS), 0, quiet)
    rows = min(len(as_effect.states), len(as_a_number.states))
    np.testing.assert_allclose(as_effect.states[:rows], as_a_number.states[:rows], rtol=1e-6, atol=1e-6)

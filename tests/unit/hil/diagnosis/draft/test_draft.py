"""``prepare`` on a stranger's table: which signal, unit, sign and lag; what is left open; what explain makes of it."""

import json
import math
import re
from pathlib import Path

import numpy as np
import outsider
import pytest
import strange_logs as strange

from hil.cli.main import main
from hil.diagnosis.data.channel_map import load_map
from hil.diagnosis.data.log import PRESSURE, WHEEL_SPEED, UnusableError
from hil.diagnosis.data.read import read_logs
from hil.diagnosis.data.trial.run import on_trial
from hil.diagnosis.draft.compare import compared
from hil.diagnosis.draft.drafting import draft
from hil.diagnosis.draft.files import write_draft
from hil.diagnosis.draft.guess import Draft, Guess
from hil.diagnosis.draft.signals import read_signals
from hil.diagnosis.draft.unit_choice import Scales, unit_choices
from hil.diagnosis.explain import explain
from hil.diagnosis.vehicle.load import load_vehicle
from hil.diagnosis.vehicle.trial_car import car_of

CHANNELS = strange.drive()


def _drafted(path: Path, channels=CHANNELS, heads=strange.HEADS) -> Draft:
    return draft(read_signals([strange.write(path / "drive.csv", channels, heads)], None))


def _guesses(found: Draft) -> dict[str, Guess]:
    return {one.channel: one for one in found.guesses}


def _with_head(channel: str, head: str, factor: float) -> dict[str, tuple[str, float]]:
    return {**strange.HEADS, channel: (head, factor)}


@pytest.fixture(scope="module")
def usual(tmp_path_factory) -> Draft:
    return _drafted(tmp_path_factory.mktemp("usual"), strange.late(CHANNELS, "ax_mps2", 9))


def test_signals_units_and_signs_are_found(usual: Draft) -> None:
    found = _guesses(usual)
    assert {name: (one.signal, one.unit, one.sign) for name, one in found.items()} == {
        **{f"wheel_speed_{w}_rad_s": (f"WhlSpd_{w.upper()}", "km/h", 1) for w in strange.WHEELS},
        "speed_mps": ("GPS_Speed", "mph", 1), "ax_mps2": ("Acc_X", "g", -1), "ay_mps2": ("LateralAcc", "m/s2", 1),
        "yaw_rate_rad_s": ("GyroYaw", "deg/s", -1), "steer_rad": ("SteeringWheelAngle", "deg", 1),
        **{f"pressure_{w}_pa": (f"pBrake{w.upper()}", "bar", 1) for w in strange.WHEELS},
        "pedal": ("BrakePedal", "%", 1),
    }  # fmt: skip
    assert all(one.complete for one in found.values())


def test_what_was_measured_is_the_truth_within_its_interval(usual: Draft) -> None:
    found = _guesses(usual)
    along = found["ax_mps2"].evidence
    assert along is not None
    assert along.lag_s == pytest.approx(0.09, abs=0.015)
    assert -1.1 < along.ratio < -0.95
    assert any("gravity is in it" in text for text in found["ax_mps2"].measured)
    track = next(one for one in usual.numbers if one.key == "track_m")
    assert track.value == pytest.approx(strange.TRACK_M, abs=track.half_width)
    steering = next(one for one in usual.numbers if one.key == "steering_ratio")
    assert steering.value is None
    product = float(steering.text.split("= ")[1].split()[0])
    assert product == pytest.approx(strange.WHEELBASE_M * strange.RATIO, rel=0.05)
    slowed = next(one for one in usual.numbers if one.key == "brake_gain_front_nm_pa").text.split("= ")[1]
    assert float(slowed.split()[0]) == pytest.approx(strange.PER_PA, rel=0.05)


@pytest.mark.parametrize(
    ("channel", "head", "factor", "unit"),
    [
        ("ax_mps2", "accel_long", 1.0 / 9.80665, "g"), ("ax_mps2", "accel_long", 1.0, "m/s2"),
        ("yaw_rate_rad_s", "yaw", 180.0 / np.pi, "deg/s"),
        ("speed_mps", "v_vehicle", 3.6, "km/h"),
        ("ay_mps2", "acc_y", 1.0 / 9.80665, "g"), ("steer_rad", "swa", 180.0 / np.pi, "deg"),
        ("ax_mps2", "AX [m/s2]", 1.0 / 9.80665, "g"), ("yaw_rate_rad_s", "yaw [rad/s]", 180.0 / np.pi, "deg/s"),
    ],
)  # fmt: skip
def test_units_that_are_not_stated_or_stated_wrongly(tmp_path, channel, head, factor, unit) -> None:
    found = _guesses(_drafted(tmp_path, heads=_with_head(channel, head, factor)))[channel]
    assert (found.unit, found.signal) == (unit, head.split(" [")[0])
    assert "unit guessed" in found.basis


def test_wheels_in_rad_s_called_km_h_are_told_by_the_other_sensors(tmp_path) -> None:
    heads = {**strange.HEADS, **{one: (f"{one[12:14]} speed [km/h]", 1.0) for one in WHEEL_SPEED}}
    found = _drafted(tmp_path, heads=heads)
    wheel = _guesses(found)[WHEEL_SPEED[0]]
    assert wheel.unit == "rad/s"
    assert any("stated is km/h" in text for text in wheel.unknown)
    radius = next(one for one in found.numbers if one.key == "rolling_radius_m")
    assert radius.value == pytest.approx(strange.RADIUS_M, abs=radius.half_width)
    assert "rolling_radius_m" not in found.missing


def test_names_that_say_nothing(tmp_path) -> None:
    """Four speeds and an accelerometer are found by their values alone; which wheel is which stays open."""
    names = {name: (f"ch{k}", factor) for k, (name, (_, factor)) in enumerate(strange.HEADS.items())}
    found = _guesses(_drafted(tmp_path, heads=names | {"t_s": ("time", 1.0)}))
    wheels = {found[name].signal for name in WHEEL_SPEED}
    assert wheels == {names[name][0] for name in WHEEL_SPEED}
    assert any("front and rear" in text for text in found[WHEEL_SPEED[0]].unknown)
    assert (found["ax_mps2"].signal, found["ax_mps2"].sign) == (names["ax_mps2"][0], -1)


def test_a_pressure_of_unknown_scale_stays_a_comment(tmp_path) -> None:
    heads = {**strange.HEADS, **dict.fromkeys(PRESSURE, ("", 1.0))}
    heads = {name: head for name, head in heads.items() if head[0]}
    raw = np.round(CHANNELS[PRESSURE[0]] / 6.9e3)
    found = _drafted(tmp_path, {**CHANNELS, "raw": raw}, {**heads, "raw": ("BRAKE_PRESSURE_RAW", 1.0)})
    guess = _guesses(found)[PRESSURE[0]]
    assert (guess.signal, guess.complete) == ("BRAKE_PRESSURE_RAW", False)
    assert "brake_gain_front_nm_pa" not in found.required
    map_file, _ = write_draft(found, tmp_path / "out")
    assert PRESSURE[0] not in load_map(map_file, 0.3).entries
    assert "# scale = ?" in map_file.read_text("utf-8")


@pytest.mark.parametrize(("kind", "left_out"), [("counter", True), ("check value", True), ("on or off", False)])
def test_counters_and_check_values_are_no_pressures(tmp_path, kind, left_out) -> None:
    n = len(CHANNELS["t_s"])
    values = {
        "counter": (np.arange(n) * 4096) % 65536,
        "check value": np.random.default_rng(1).integers(0, 256, n),
        "on or off": np.where(np.arange(n) % 60 < 30, 40.0, 0.0) + np.arange(n) % 7,
    }[kind]
    found = _drafted(tmp_path, {**CHANNELS, "n": values}, {**strange.HEADS, "n": ("BrakePressure2 [bar]", 1.0)})
    assert ("BrakePressure2" in found.left_out) is left_out


def test_signs_that_all_turn_leave_two_readings(tmp_path) -> None:
    heads = {
        name: (head, -factor if name in ("ay_mps2", "steer_rad") else factor)
        for name, (head, factor) in strange.HEADS.items()
    }
    found = _drafted(tmp_path, heads=heads)
    assert any("left and right of the wheels are exchanged" in text for text in found.remarks)


def test_explain_refuses_the_draft_until_it_is_filled_in(usual: Draft, tmp_path) -> None:
    log = strange.write(tmp_path / "drive.csv", CHANNELS)
    map_file, set_file = write_draft(usual, tmp_path / "out")
    with pytest.raises(
        UnusableError, match="no number yet of mass_kg, wheelbase_m, cog_to_front_axle_m, rolling_radius_m"
    ):
        explain([log], set_file, channel_map=map_file)
    set_file.write_text(set_file.read_text("utf-8").replace("# mass_kg", "mass_kg"), "utf-8")
    with pytest.raises(UnusableError, match=r"not filled in: mass_kg \(line"):
        explain([log], set_file, channel_map=map_file)
    strange.fill_in(set_file, {"mass_kg": 1.0})
    set_file.write_text(set_file.read_text("utf-8").replace("mass_kg = ?", "mass_kg = 1650.0"), "utf-8")
    strange.fill_in(set_file, {key: value for key, value in strange.SET.items() if key != "brake_gain_rear_nm_pa"})
    with pytest.raises(UnusableError, match="no number yet of brake_gain_rear_nm_pa;"):
        explain([log], set_file, channel_map=map_file)


def test_the_trial_of_the_inputs_takes_what_was_drafted(usual: Draft, tmp_path) -> None:
    log = strange.write(tmp_path / "drive.csv", CHANNELS)
    map_file, set_file = write_draft(usual, tmp_path / "out")
    car = load_vehicle(strange.fill_in(set_file, strange.SET))
    assert car.stated["vehicle_mass_kg"] == "mass_kg"
    mapped = load_map(map_file, float(car.parameters.wheel.rolling_radius_m))
    (read,) = on_trial(read_logs([log], None, mapped), car_of(car))
    for name, truth in CHANNELS.items():
        if name in read.channels:
            assert np.allclose(read.channels[name], truth, rtol=1e-4, atol=2e-4 * np.abs(truth).max()), name


def test_files_are_never_replaced(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = strange.write(tmp_path / "drive.csv", CHANNELS)
    assert main(["prepare", str(log), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["missing"][:2] == ["mass_kg", "wheelbase_m"]
    assert said["channels"][0]["channel"] == "wheel_speed_fl_rad_s"
    Path("SET.toml").write_text("mass_kg = 1650.0\n")
    assert main(["prepare", str(log)]) == 2
    assert "not replaced" in capsys.readouterr().err
    assert Path("SET.toml").read_text() == "mass_kg = 1650.0\n"


@pytest.mark.parametrize("columns", [{"Oil [bar]": 1.0}, {"WheelSpeed": 0.0}])
def test_without_a_speed_nothing_is_drafted(tmp_path, capsys, columns) -> None:
    t = CHANNELS["t_s"]
    made = np.column_stack([t, *[(1.0 + np.sin(t)) * size for size in columns.values()]])
    np.savetxt(tmp_path / "a.csv", made, delimiter=",", header=f"t_s,{','.join(columns)}", comments="")
    assert main(["prepare", str(tmp_path / "a.csv"), "--out", str(tmp_path)]) == 2
    assert "no four wheel speeds and no speed" in capsys.readouterr().err


def test_units_are_chosen_together() -> None:
    """Wheels in km/h beside an accelerometer in g, and in rad/s beside one in m/s2, are the readings of 35 and 3.2."""
    kmh_and_g = unit_choices(Scales("", None, ("",), None, (1.02 / 35.3,), 110.0, 30.0))
    assert (kmh_and_g[0].wheel, kmh_and_g[0].accelerations) == ("km/h", ("g",))
    stated = unit_choices(Scales("rad/s", None, ("m/s2",), None, (0.33,), 90.0, 10.0))[0]
    assert stated.wheel == "rad/s"
    assert stated.radius_m == pytest.approx(0.32, abs=0.01)
    with_ground = unit_choices(Scales("", "m/s", (), 0.31, (), 90.0, 10.0))[0]
    assert (with_ground.wheel, with_ground.ground) == ("rad/s", "m/s")


def test_a_car_that_somebody_else_wrote(tmp_path) -> None:
    """Four motors and four brakes in anybody's names: torques by wheel, demands apart from what was measured."""
    log = outsider.drive("mixed", 11, lambda v, p: np.ones(4))
    heads = {"t_s": ("t_s", 1.0), "speed_mps": ("vGround [km/h]", 3.6), "ax_mps2": ("along [mg]", 1e3 / 9.80665)}
    for wheel, place in zip(strange.WHEELS, ("VL", "VR", "HL", "HR"), strict=True):
        heads |= {
            f"wheel_speed_{wheel}_rad_s": (f"Raddrehzahl_{place} [1/min]", 30.0 / np.pi),
            f"pressure_{wheel}_pa": (f"Bremsdruck_{place} [MPa]", 1e-6),
            f"pressure_demand_{wheel}_pa": (f"Bremsdruck_Soll_{place} [MPa]", 1e-6),
            f"motor_torque_{wheel}_nm": (f"Moment_{place} [Nm]", -1.0),
            f"motor_torque_demand_{wheel}_nm": (f"Moment_Soll_{place} [Nm]", -1.0),
        }
    found = _drafted(tmp_path, log, heads)
    guesses = _guesses(found)
    assert len(guesses) == 4 * 5 + 2
    for channel, guess in guesses.items():
        assert heads[channel][0].startswith(f"{guess.signal} [")
        assert guess.sign == (-1 if channel.startswith("motor") else 1)
    assert {guesses[name].unit for name in (WHEEL_SPEED[0], "ax_mps2", PRESSURE[0])} == {"rpm", "mg", "mpa"}
    radius = next(one for one in found.numbers if one.key == "rolling_radius_m")
    assert radius.value == pytest.approx(outsider.VEHICLE["rolling_radius_m"], rel=0.01)


@pytest.mark.slow
def test_our_own_bus_in_strangers_names_goes_all_the_way(tmp_path, capsys) -> None:
    """A recording, written as somebody else would, drafted, filled in with the sheet's numbers, and explained."""
    assert main(["run", "brake_in_turn", "--virtual", "--out", str(tmp_path / "run"), "--json"]) == 0
    recorded = read_logs([tmp_path / "run" / "recording.log"])
    shipped = load_vehicle(None).parameters
    radius = float(shipped.wheel.rolling_radius_m)
    heads = {name: head for name, head in strange.HEADS.items() if name != "speed_mps"}
    heads |= {name: (head, 3.6 * radius) for name, (head, _) in heads.items() if name in WHEEL_SPEED}
    heads |= {f"motor_torque_{w}_nm": (f"MotorTorque_{w.upper()} [Nm]", 1.0) for w in strange.WHEELS}
    files = []
    for k, log in enumerate(recorded):
        channels = strange.late({"t_s": log.t_s, **log.channels}, "ax_mps2", 2)
        files.append(str(strange.write(tmp_path / f"{k}.csv", channels, heads)))
    assert main(["prepare", *files, "--out", str(tmp_path)]) == 0
    front, rear = shipped.vehicle.cog_to_axle_m
    brake, pad = shipped.friction_brake, shipped.pad
    per_area = 2.0 * pad.a_1_ks / pad.b_1_j * 423.15 / pad.epsilon_w * brake.efficiency
    gains = [
        float(per_area * area * lever)
        for area, lever in zip(brake.piston_area_m2, brake.effective_radius_m, strict=True)
    ]
    strange.fill_in(tmp_path / "SET.toml", {
        "mass_kg": shipped.vehicle.mass_kg, "wheelbase_m": front + rear, "cog_to_front_axle_m": front,
        "rolling_radius_m": radius, "brake_gain_front_nm_pa": gains[0], "brake_gain_rear_nm_pa": gains[1],
    })  # fmt: skip
    capsys.readouterr()
    options = ["--map", str(tmp_path / "CHANNELS.toml"), "--vehicle", str(tmp_path / "SET.toml"), "--json"]
    assert main(["explain", *files, *options]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] not in ("unusable", "model_does_not_describe")  # pads that fade are told as one gain
    assert {one["column"] for one in answer["channels_read"]} >= {"WhlSpd_FL", "Acc_X", "GyroYaw", "pBrakeFL"}
    assert answer["held_out_error"]["wheel_speed"]["after"] < answer["held_out_error"]["wheel_speed"]["before"]


def test_a_lag_at_the_end_of_the_search_is_not_determined():
    t_s = np.arange(0.0, 60.0, 0.02)
    seen = compared(np.sin(0.3 * t_s), np.sin(0.3 * (t_s - 3.0)), "the wheels")  # later than is looked for
    assert math.isnan(seen.lag_s)
    assert "lag not determined" in seen.text
    assert json.loads(json.dumps(seen.as_json()))["lag_s"] is None
    late = compared(np.sin(t_s), np.sin(t_s - 0.2), "the wheels")
    assert late.lag_s == pytest.approx(0.2, abs=0.01)
    assert re.search(r"(?:199|20[01]) ms late", late.text)

"""Scenarios: the library, every field, and what a wrong file is told."""

import contextlib
import itertools
import json
import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bench.result import measure
from hil.bench.run import expected
from hil.bench.virtual import simulate
from hil.cli.main import main
from hil.errors import BrakebenchError
from hil.faults.catalogue import names
from hil.scenario.expectations import EXPECTABLE
from hil.scenario.scenario import load_scenario, scenario_names
from hil.scenario.table import ScenarioError
from hil.scenario.waveforms import GENERATORS
from plant.manoeuvre import value_at

QUICK = ("battery_full_mid_stop", "motor_dead_mid_stop", "mu_jump", "pressure_steps", "regeneration_pulses", "stop72")
FULL = """title = "everything"
blending = { steps = { start_s = 1.0, high = 0.7, count = 2, hold_s = 1.0 } }
[plant]
set = "paper_car"
vehicle.mass_kg = 1500.0
[ecu]
blend.blending_factor = 0.2
[start]
speed_mps = 20.0
disc_temperature_k = 400.0
state_of_charge = 0.5
wait_for_ecu = true
plant_after_s = 0.5
ecu_after_s = 1.0
[driver]
pedal = { csv = "pedal.csv", column = "travel" }
steering_wheel_rad = [[0.0, 0.0], [1.0, 0.2]]
hold_speed = [{ start_s = 0.0, end_s = 2.0, speed_mps = 20.0 }]
[direct.pressure_pa]
all = { triangle = { start_s = 1.0, high = 20e5, count = 2, period_s = 2.0 } }
fl = { pulses = { start_s = 1.0, high = 20e5, count = 2, period_s = 2.0, width_s = 1.0, ramp_s = 0.1 } }
[direct.motor_nm]
rr = { chirp = { start_s = 1.0, duration_s = 2.0, from_hz = 0.5, to_hz = 2.0, amplitude = 100.0 } }
[[road]]
start_m = 0.0
friction = 0.8
[[road]]
start_m = 50.0
friction_left = 0.2
grade = 0.05
[[faults]]
at_s = 1.0
fault = "motor_dead"
wheels = ["fl", "rr"]
until_s = 2.0
[[frame_faults]]
messages = ["WHEEL_SPEED_FRONT"]
drop = 0.02
late = 0.1
longest_ticks = 3
from_s = 1.5
until_s = 3.5
[end]
duration_s = 5.0
after_standstill_s = false
[expect.stop_distance_m]
max = 100.0
[[expect_signal]]
signal = "TRUTH_MOTION.SPEED"
from_s = 1.0
to_s = 2.0
min = 0.0
"""
PEDAL = "time_s,travel\n0.0,0.0\n1.0,0.5\n"


@pytest.fixture
def write(tmp_path):
    (tmp_path / "pedal.csv").write_text(PEDAL)

    def to(text, name="mine.toml"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return to


def test_the_library_is_listed_with_titles(capsys):
    assert main(["scenarios", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["scenarios"]
    assert [row["name"] for row in rows] == scenario_names()
    assert len(rows) >= 15
    for row in rows:
        assert 10 < len(row["title"]) <= 100
        assert row["expects"]
    assert main(["scenarios"]) == 0
    text = " ".join(capsys.readouterr().out.split())  # lines may be broken within a title
    assert all(row["title"] in text for row in rows)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in scenario_names()]
)
def test_what_a_scenario_of_the_library_expects_comes(name):
    scenario = load_scenario(name)
    signals = simulate(scenario)
    numbers = list(expected(scenario, measure(signals), signals))
    assert numbers
    for number in numbers:
        print(name, number.label, number.value, number.limit)
        assert number.met, number


def test_every_field_arrives(write):
    s = load_scenario(write(FULL))
    assert s.plant.vehicle.mass_kg == 1500.0
    assert s.ecu.blend.blending_factor == 0.2
    assert (s.start_order.plant_s, s.start_order.ecu_s) == (0.5, 1.0)
    m = s.manoeuvre
    assert (m.initial_speed_mps, m.initial_disc_temperature_k, m.initial_state_of_charge) == (20.0, 400.0, 0.5)
    assert m.pedal == ((0.0, 0.0), (1.0, 0.5))
    assert value_at(m.direct.pressure_pa[1], 2.0) == 20e5
    assert value_at(m.direct.pressure_pa[0], 1.5) == 20e5
    assert m.direct.pressure_pa[0] != m.direct.pressure_pa[3]
    assert not m.direct.motor_nm[0]
    assert max(v for _, v in m.direct.motor_nm[3]) == pytest.approx(100.0, abs=0.5)
    assert (m.road[1].friction_left, m.road[1].friction_right, m.road[1].grade) == (0.2, 1.0, 0.05)
    assert m.end_after_standstill_s is None
    assert [value_at(s.blending, t) for t in (0.5, 1.5, 2.5, 4.0)] == [0.0, 0.35, 0.7, 0.0]
    dead, lost, late = s.faults
    assert (dead.kind.name, dead.target.wheels, dead.at_s, dead.until_s) == ("motor_dead", 0b1001, 1.0, 2.0)
    assert (lost.kind.name, lost.number("share"), lost.at_s, lost.until_s) == ("lost", 0.02, 1.5, 3.5)
    assert (late.kind.name, late.number("share"), late.number("ticks")) == ("late", 0.1, 3)
    assert lost.target.can_ids == late.target.can_ids == {0xC0}
    assert s.signal_expectations[0].name == "TRUTH_MOTION.SPEED from 1 s to 2 s"
    assert load_scenario(write(FULL, "b.toml")).sha256 == s.sha256


def test_the_documented_file_is_one(write):
    text = Path(__file__).parents[4].joinpath("docs/scenarios.md").read_text()
    scenario = load_scenario(write(text.split("```toml\n")[1].split("```")[0]))
    assert scenario.plant.vehicle.mass_kg == 1600.0
    assert len(scenario.faults) == 4
    fields = set(re.findall(r"^\[*(\w+)|^(\w+) =", text, re.MULTILINE))
    assert {"blending", "faults", "expect_signal"} <= {name for pair in fields for name in pair}
    assert all(name in text for name in (*GENERATORS, *names("physical"), *EXPECTABLE))


def test_the_hash_covers_the_csv(write, tmp_path):
    before = load_scenario(write(FULL)).sha256
    (tmp_path / "pedal.csv").write_text(PEDAL + "2.0,0.1\n")
    assert load_scenario(write(FULL)).sha256 != before


WRONG = [
    ("speed_mps = 20.0", "speed = 20.0", "mine.toml: start.speed_mps: expected a number from -15 to 60, got None"),
    ("speed_mps = 20.0\ndisc", "speed_mps = 99.0\ndisc", "expected a number from -15 to 60, got 99.0"),
    ("speed_mps = 20.0\ndisc", "speed_mps = nan\ndisc", "expected a number from -15 to 60, got nan"),
    ("speed_mps = 20.0\ndisc", "speed_mps = 20.0\nodd = 1\ndisc", "start: unknown key 'odd'; known here: disc_temp"),
    ("wait_for_ecu = true", "wait_for_ecu = 1", "start.wait_for_ecu: expected true or false, got 1"),
    ("after_standstill_s = false", "after_standstill_s = true", "end.after_standstill_s: expected a number from"),
    ("after_standstill_s = false", 'after_standstill_s = "x"', "end.after_standstill_s: expected a number from"),
    ('title = "everything"', "", "mine.toml: title: expected a line of text, got None"),
    ('title = "everything"', 'title = "a\\u0000b"', "title: expected a line of text"),
    ("duration_s = 5.0", "duration_s = " + "9" * 400, "end.duration_s: expected a number from 0.1 to 3600"),
    ("mass_kg = 1500.0", "mass_kg = 15.0", "plant.vehicle.mass_kg: expected"),
    ("vehicle.mass_kg", "vehicle.mass", "plant.vehicle: unknown key 'mass'; known here:"),
    ('set = "paper_car"', 'set = "no_car"', "cannot be read"),
    ('"motor_dead"', '"motor_ded"', "faults[0].fault: no fault 'motor_ded'; did you mean 'motor_dead'?"),
    ('["fl", "rr"]', '["fl", "xx"]', "faults[0].wheels: expected a list out of fl, fr, rl, rr"),
    ('["fl", "rr"]', '["fl", "fl"]', "faults[0].wheels: expected a list out of fl, fr, rl, rr"),
    ('["fl", "rr"]', "[[1], {}]", "faults[0].wheels: expected a list out of fl, fr, rl, rr"),
    ("until_s = 2.0", "until_s = 0.5", "faults[0].until_s: expected a number from 1 to 3600"),
    ('["WHEEL_SPEED_FRONT"]', '["TRUTH_MOTION"]', "frame_faults[0].messages: expected a list out of BATTERY_STATUS, "),
    ("drop = 0.02", "drop = 1.02", "frame_faults[0].drop: expected a number from 0 to 1, got 1.02"),
    ("until_s = 3.5", "until_s = 1.0", "frame_faults[0].until_s: expected a number from 1.5 to 3600"),
    ("[1.0, 0.2]", "[1.0, 20.0]", "driver.steering_wheel_rad: expected values from -15 to 15, got 20 at 1 s"),
    ("[1.0, 0.2]", "[-1.0, 0.2]", "driver.steering_wheel_rad: times must not decrease, but -1 s follows 0 s"),
    ("[1.0, 0.2]", "[1.0]", "driver.steering_wheel_rad: expected a list of [time_s, value] pairs"),
    ("triangle =", "square =", "pressure_pa.all: expected one of csv, steps, pulses, triangle, chirp, got ['square']"),
    ("period_s = 2.0 } }\nfl", "period = 2.0 } }\nfl", "triangle.period_s: expected a number from 0.02 to 3600"),
    ("width_s = 1.0, ramp", "width_s = 1.9, ramp", "pulses: width_s and two ramp_s must fit into period_s"),
    ("to_hz = 2.0", "to_hz = 60.0", "chirp.to_hz: expected a number from 0 to 25"),
    ("high = 20e5, count = 2, period_s", "high = 20e9, count = 2, period_s", "expected values from 0 to 2.5e+07"),
    ("pedal.csv", "no.csv", "no.csv: cannot be read (No such file or directory); it is looked for beside"),
    ("travel", "travels", "pedal.csv: no column 'travels'; it has 'time_s', 'travel'"),
    ("TRUTH_MOTION.SPEED", "TRUTH_MOTION.SPED", "no signal 'TRUTH_MOTION.SPED'; did you mean TRUTH_MOTION.SPEED"),
    ("to_s = 2.0\nmin = 0.0", "to_s = 2.0", "expect_signal[0].min: expected min, max or both"),
    ("stop_distance_m", "stop_distance", "expect: unknown key 'stop_distance'; known here: energy"),
    ("[[road]]\nstart_m = 0.0", "[[road]]", "road[0].start_m: expected a number, got None"),
    ("[[road]]\nstart_m = 0.0", "[road]", "not valid TOML"),
    ("hold_speed = [{", "hold_speed = [3, {", "driver.hold_speed[0]: expected a table, got 3"),
]


@pytest.mark.parametrize(("good", "bad", "message"), WRONG)
def test_a_wrong_field_names_file_key_and_what_is_allowed(write, good, bad, message):
    assert good in FULL
    with pytest.raises(BrakebenchError) as caught:
        load_scenario(write(FULL.replace(good, bad, 1)))
    assert message in str(caught.value)
    assert "mine.toml" in str(caught.value) or "no_car" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,travel\n0.0,x\n", "pedal.csv, line 2: expected two numbers, got '0.0' and 'x'"),
        ("time_s,travel\n0.0\n", "line 2: expected two numbers, got '0.0' and None"),
        ("time_s,travel\n0.0,nan\n", "line 2: expected two numbers"),
        ("time_s,travel\n", "pedal.csv: has no rows"),
        ("", "pedal.csv: no column 'time_s'; it has none"),
        ('time_s,travel\n"0.0,1\n', "pedal.csv: not a CSV file"),
        (b"\xff\xfe", "pedal.csv: not UTF-8 text"),
    ],
)
def test_a_wrong_csv_is_named_with_its_line(write, text, message):
    write(text, "pedal.csv")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write(FULL))
    assert message in str(caught.value)


LINES = FULL.splitlines()
VALUES = [
    "true",
    "-1",
    "1e400",
    "nan",
    "9" * 400,
    '""',
    '"x"',
    "[]",
    "[[]]",
    "{}",
    "[1, 2]",
    "1979-05-27",
    "{ csv = 3 }",
]


@given(st.data())
def test_no_mutated_file_gives_anything_but_our_own_errors(tmp_path_factory, data):
    lines = list(LINES)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        kind = data.draw(st.sampled_from(["drop", "double", "value", "splice", "swap"]))
        if kind == "drop":
            lines[at] = ""
        elif kind == "double":
            lines.insert(at, lines[at])
        elif kind == "value" and "=" in lines[at]:
            lines[at] = f"{lines[at].partition('=')[0]}= {data.draw(st.sampled_from(VALUES))}"
        elif kind == "splice":
            cut = data.draw(st.integers(0, len(lines[at])))
            lines[at] = lines[at][:cut] + data.draw(st.text(max_size=6)) + lines[at][cut:]
        else:
            other = data.draw(st.integers(0, len(lines) - 1))
            lines[at], lines[other] = lines[other], lines[at]
    folder = tmp_path_factory.getbasetemp() / "mutated"
    folder.mkdir(exist_ok=True)
    (folder / "pedal.csv").write_text(PEDAL)
    path = folder / "m.toml"
    path.write_text("\n".join(lines), encoding="utf-8", errors="surrogatepass")
    with contextlib.suppress(BrakebenchError):
        assert math.isfinite(load_scenario(str(path)).manoeuvre.duration_s)


@pytest.mark.parametrize("text", ["[" * 100_000, "a = " + "[" * 5000, "\ufeff", "a = 1\x00", "=", b"\xff"])
def test_what_is_no_toml_is_said_to_be_none(write, text):
    with pytest.raises(ScenarioError, match=r"not valid TOML|title: expected"):
        load_scenario(write(text))


def test_generators_end_where_they_began():
    made = {
        "steps": {"start_s": 1.0, "low": 1.0, "high": 4.0, "count": 3, "hold_s": 2.0, "ramp_s": 0.1},
        "pulses": {"start_s": 1.0, "low": 1.0, "high": 4.0, "count": 3, "period_s": 2.0, "width_s": 1.0, "ramp_s": 0.1},
        "triangle": {"start_s": 1.0, "low": 1.0, "high": 4.0, "count": 3, "period_s": 2.0},
    }
    for name, arguments in made.items():
        assert set(arguments) == {p.name for p in GENERATORS[name].parameters}
        points = GENERATORS[name].make(**arguments)
        assert points[0] == (1.0, 1.0)
        assert points[-1][1] == 1.0
        assert max(v for _, v in points) == 4.0
        assert [t for t, _ in points] == sorted(t for t, _ in points)


def test_a_chirp_runs_through_its_frequencies():
    points = GENERATORS["chirp"].make(start_s=1.0, duration_s=10.0, from_hz=1.0, to_hz=3.0, mean=5.0, amplitude=2.0)
    inside = [(t, v - 5.0) for t, v in points[2:-1]]
    crossings = [t for (t, a), (_, b) in itertools.pairwise(inside) if a <= 0.0 < b]
    assert len(crossings) == pytest.approx(20, abs=1)  # mean frequency 2 Hz over 10 s
    assert crossings[1] - crossings[0] > 2.0 * (crossings[-1] - crossings[-2])
    assert max(abs(v) for _, v in inside) <= 2.0

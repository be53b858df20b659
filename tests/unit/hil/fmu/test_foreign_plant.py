"""Somebody else's FMU in the car's place: runs, and a crash or a stall ends the run with its name."""

import os
import signal
import sys
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("fmpy", reason="FMUs are loaded with FMPy: pip install 'brakebench[fmu]'")

from dbc.messages import BrakeMode
from hil.bench.virtual import simulate
from hil.cli.main import main
from hil.fmu.export import export
from hil.fmu.foreign import ForeignFmu
from hil.fmu.foreign_plant import open_plant
from hil.fmu.model import FmuError
from hil.fmu.plant_map import REQUESTED, TOLD
from hil.scenario.scenario import load_scenario

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[4]
SCENARIO = load_scenario("stop72")
MASS = (ROOT / "examples" / "mass_plant.toml").read_text()


@pytest.fixture(scope="module")
def car(tmp_path_factory):
    """Our own car as an FMU, and a map that names everything once."""
    folder = tmp_path_factory.mktemp("car")
    export("plant", SCENARIO, folder / "car.fmu")
    lines = ["[inputs]", *(f'"{name}" = "{name}"' for name in REQUESTED[:8])]
    lines += ['"STEERING.STEERING_WHEEL_ANGLE" = "DRIVER.STEERING_WHEEL_ANGLE"', "[outputs]"]
    theirs = [n for n in TOLD if not n.startswith(("BRAKE_PEDAL", "STEERING")) and "EHB_STATE" not in n]
    (folder / "car.toml").write_text("\n".join([*lines, *(f'"{name}" = "{name}"' for name in theirs)]))
    return folder / "car.fmu", folder / "car.toml"


@pytest.fixture(autouse=True)
def _python(monkeypatch):
    monkeypatch.setenv("BRAKEBENCH_PYTHON", sys.executable)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


def held(fmu):
    """Process ids of hosts of FMUs that we started."""
    found = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    return [int(pid) for pid in found if b"hil.fmu.host" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def stopping_distance_m(signals):
    time_s, distance = signals.get("TRUTH_MOTION.DISTANCE")
    return distance[-1] - distance[np.searchsorted(time_s, 0.0)]


def test_our_own_car_as_an_fmu_stops_where_our_car_stops(car):
    with open_plant(*car, 1, 20.0) as plant:
        assert "steps of 1 ms" in str(plant)
        theirs = simulate(SCENARIO, plant=plant.node(SCENARIO))
    assert stopping_distance_m(theirs) == pytest.approx(stopping_distance_m(simulate(SCENARIO)), abs=1.0)


def test_a_crash_ends_the_run_with_the_fmus_name(car, tmp_path, capsys, monkeypatch):
    step, ticks = ForeignFmu.step, [0]

    def dying(self, *words):
        ticks[0] += 1
        if ticks[0] == 50:
            os.kill(held(self)[0], signal.SIGSEGV)
        return step(self, *words)

    monkeypatch.setattr(ForeignFmu, "step", dying)
    words = ["run", "--virtual", "--plant", str(car[0]), "--map", str(car[1]), "--out", str(tmp_path / "run")]
    assert main(words) == 3
    assert "car.fmu: the FMU has crashed: killed by SIGSEGV" in capsys.readouterr().out
    assert (tmp_path / "run" / "recording.log").stat().st_size > 10_000
    assert "car.fmu (brakebench_plant, FMI 3.0, brakebench" in (tmp_path / "run" / "report.html").read_text()


def test_a_stall_ends_with_the_fmus_name(car):
    one = ForeignFmu(car[0], step_timeout_s=0.3)
    (pid,) = held(one)
    os.kill(pid, signal.SIGSTOP)
    with pytest.raises(FmuError, match=r"car\.fmu: the FMU has stalled: no answer for 0\.3 s"):
        one.step({}, 1, 0.001, [])
    assert held(one) == []


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (("[inputs]", '[inputs]\nbrake = "DRIVER.PEDAL"'), r"car\.fmu: has no number brake"),
        (("[inputs]", '[parameters]\n"vehicle.mass_kg" = 1\n[inputs]'), r"mass_kg: expected 300 to 5000 kg, got 1\.0"),
        (("[inputs]", "[parameters]\nmass = 1\n[inputs]"), r"car\.fmu: has no number mass"),
    ],
)
def test_a_map_that_does_not_fit_is_refused_and_nothing_is_left(car, tmp_path, edit, words):
    (tmp_path / "map.toml").write_text(car[1].read_text().replace(*edit))
    with pytest.raises(FmuError, match=words):
        open_plant(car[0], tmp_path / "map.toml", 1, 20.0).node(SCENARIO)
    assert held(None) == []


def test_what_is_no_fmu_is_refused(tmp_path):
    (tmp_path / "no.fmu").write_bytes(b"PK")
    with pytest.raises(FmuError, match=r"no\.fmu: "):
        ForeignFmu(tmp_path / "no.fmu")
    with pytest.raises(FmuError, match="no such FMU"):
        ForeignFmu(tmp_path / "none.fmu")


def test_a_map_needs_its_fmu_and_virtual_time(capsys):
    assert main(["run", "--map", "map.toml", "--virtual"]) == 2
    assert main(["run", "--map", "map.toml", "--plant", "x.fmu"]) == 2
    said = capsys.readouterr().err
    assert "--plant FMU goes with --map MAP.toml; give both or neither" in said
    assert "no tick could be promised in real time; add --virtual" in said


def crane(name):
    """An FMU of another author (MIT), FMI 2, made by pythonfmu."""
    pytest.importorskip("crane_fmu", reason="FMUs of another author: pip install 'brakebench[test]'")
    return Path(distribution("crane-fmu").locate_file(f"examples/{name}.fmu"))


def test_anothers_mass_and_damper_is_braked_by_the_controllers_pressures(tmp_path):
    (tmp_path / "mass.toml").write_text(MASS)
    with open_plant(crane("HarmonicOscillator6D"), tmp_path / "mass.toml", 1, 20.0) as plant:
        assert str(plant).endswith("steps of 10 ms")
        signals = simulate(SCENARIO, plant=plant.node(SCENARIO))
    time_s, speed = signals.get("TRUTH_MOTION.SPEED")
    before = np.searchsorted(time_s, 3.0)
    assert (signals.get("BRAKE_STATUS.MODE")[1] == BrakeMode.NORMAL).any()
    assert speed[before] < 19.0
    expected = 20.0
    for name, gain in (("FRONT.PRESSURE_DEMAND_F", 4.51e-7), ("REAR.PRESSURE_DEMAND_R", 1.91e-7)):
        for side in "LR":
            asked_s, asked_pa = signals.get(f"EHB_DEMAND_{name}{side}")
            inside = (asked_s > 0.0) & (asked_s < 3.0)
            expected -= gain * np.trapezoid(asked_pa[inside], asked_s[inside])
    assert speed[before] == pytest.approx(expected, abs=0.05)


def test_anothers_force_generator_is_a_car_whose_speed_swings(tmp_path):
    (tmp_path / "wave.toml").write_text('[outputs]\n"TRUTH_MOTION.SPEED" = { fmu = "f[0]", offset = 20.0 }\n')
    with open_plant(crane("DrivingForce"), tmp_path / "wave.toml", 1, 20.0) as plant:
        signals = simulate(SCENARIO, plant=plant.node(SCENARIO))
    speed = signals.get("TRUTH_MOTION.SPEED")[1]
    assert (speed.min(), speed.max()) == pytest.approx((17.0, 23.0), abs=0.05)  # its amplitude is 3

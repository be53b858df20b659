"""`explain --plant`: real FMUs over our own recordings, in their own processes."""

import json
import os
import signal
import sys
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("fmpy", reason="FMUs are loaded with FMPy: pip install 'brakebench[fmu]'")

from hil.cli.main import main
from hil.diagnosis.data.log import UnusableError
from hil.diagnosis.explain import logs_of, vehicle_of
from hil.diagnosis.foreign_plant.residuals import residuals
from hil.fmu.export import export
from hil.fmu.foreign import ForeignFmu
from hil.fmu.plant_map import REQUESTED, TOLD
from hil.scenario.scenario import load_scenario

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[5]
MASS = ROOT / "examples" / "mass_plant.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Our own car as an FMU with a map that names everything, the same with another mass, and a recorded stop."""
    folder = tmp_path_factory.mktemp("residuals")
    export("plant", load_scenario("stop72"), folder / "car.fmu")
    start = 'start_speed = "start.speed_mps"\n[parameters]\n"start.disc_temperature_k" = 423.15\nseed = 7\n'
    lines = ["[inputs]", *(f'"{name}" = "{name}"' for name in REQUESTED[:8])]
    lines += ['"STEERING.STEERING_WHEEL_ANGLE" = "DRIVER.STEERING_WHEEL_ANGLE"', "[outputs]"]
    theirs = [n for n in TOLD if not n.startswith(("BRAKE_PEDAL", "STEERING")) and "EHB_STATE" not in n]
    lines += [f'"{name}" = "{name}"' for name in theirs]
    (folder / "car.toml").write_text(start + "\n".join(lines))
    (folder / "heavy.toml").write_text(start + '"vehicle.mass_kg" = 1700.0\n' + "\n".join(lines))
    assert main(["run", "stop72", "--virtual", "--out", str(folder / "stop")]) == 0
    return folder


@pytest.fixture(autouse=True)
def _python(monkeypatch):
    monkeypatch.setenv("BRAKEBENCH_PYTHON", sys.executable)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))


def from_release_on(path):
    """The recording from where the driver lets the speed go, which he held without a demand."""
    (log,) = logs_of(path, vehicle_of(None), None, None, None, False)
    holds = np.abs(np.nan_to_num(log.channels["motor_torque_fl_nm"])) > 8.0
    first = int(np.flatnonzero(holds)[-1]) + 5
    channels = {name: values[first:] for name, values in log.channels.items()}
    return replace(log, t_s=log.t_s[first:], channels=channels)


def test_our_own_car_leaves_noise_and_a_heavier_one_does_not(folder):
    log = from_release_on(folder / "stop" / "recording.log")
    own = residuals([log], folder / "car.fmu", folder / "car.toml")
    assert len(own.channels) == 15
    assert max(one.over_noise for one in own.channels) < 2.5, own.json["headline"]
    heavy = residuals([log], folder / "car.fmu", folder / "heavy.toml")
    beyond = {one.channel for one in heavy.channels if one.over_noise > 10.0}
    assert beyond == {"ax_mps2", *(f"wheel_speed_{wheel}_rad_s" for wheel in ("fl", "fr", "rl", "rr"))}
    assert heavy.channels[0].bias < -0.5  # it stops later than the measured one
    assert heavy.channels[0].worst_context == "braking by friction"
    assert heavy.json["headline"].endswith("This names no cause.")


def test_the_command_prints_draws_and_says_that_it_names_no_cause(folder, tmp_path, capsys):
    log, out = str(folder / "stop" / "recording.log"), tmp_path / "out"
    pytest.importorskip("crane_fmu", reason="FMUs of another author: pip install 'brakebench[test]'")
    fmu = distribution("crane-fmu").locate_file("examples/HarmonicOscillator6D.fmu")
    words = ["explain", log, "--plant", str(fmu), "--map", str(MASS), "--out", str(out)]
    assert main(words) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "HarmonicOscillator6D.fmu misses 4 of 4 channels" in said
    assert "This names no cause." in said
    assert "none is named; explain without --plant does" in said
    content = json.loads((out / "result.json").read_text())
    assert content["names_causes"] is False
    assert content["fmu"]["step_s"] == 0.01
    assert content["fmu"]["starts_at"] is None
    assert any("no start_speed" in one for one in content["remarks"])
    assert any("motors act for" in one and "without a demand" in one for one in content["remarks"])
    assert {one["channel"][:11] for one in content["channels"]} == {"wheel_speed"}
    page = (out / "report.html").read_text()
    assert "Wheel speed: residual" in page
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["headline"] == content["headline"]


def test_a_crash_ends_with_the_fmus_name(folder, capsys, monkeypatch):
    step, rows = ForeignFmu.step, [0]

    def dying(self, *words):
        rows[0] += 1
        if rows[0] == 50:
            found = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
            (pid,) = (int(one) for one in found if b"hil.fmu.host" in Path(f"/proc/{one}/cmdline").read_bytes())
            os.kill(pid, signal.SIGSEGV)
        return step(self, *words)

    monkeypatch.setattr(ForeignFmu, "step", dying)
    log = str(folder / "stop" / "recording.log")
    assert main(["explain", log, "--plant", str(folder / "car.fmu"), "--map", str(folder / "car.toml")]) == 2
    assert "car.fmu: the FMU has crashed: killed by SIGSEGV" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--plant", "car.fmu"], "give it with one --map MAP.toml that has [outputs]"),
        (["--plant", "car.fmu", "--map", "car.toml", "--extend", "x.toml"], "leave out --reference and --extend"),
        (["--map", "car.toml", "--map", "car.toml"], "a second one goes with --plant"),
        (["--plant", "none.fmu", "--map", "car.toml"], "none.fmu: no such FMU"),
    ],
)
def test_wrong_use_is_refused(folder, capsys, monkeypatch, words, said):
    monkeypatch.chdir(folder)
    assert main(["explain", "stop/recording.log", *words]) == 2
    assert said in capsys.readouterr().err


def test_what_the_log_does_not_have_is_refused(folder):
    (folder / "target.toml").write_text(
        (folder / "car.toml").read_text().replace('= "DRIVER.STEERING_WHEEL_ANGLE"', '= "DRIVER.TARGET_SPEED"')
    )
    with pytest.raises(UnusableError, match=r"has no DRIVER\.TARGET_SPEED, which --map takes"):
        residuals(folder / "stop" / "recording.log", folder / "car.fmu", folder / "target.toml")

"""The built wheel, installed by itself: what ships with it is found from any folder."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIMIT_S = 300


def done(*command, cwd):
    process = subprocess.run(
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, timeout=LIMIT_S,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
    )  # fmt: skip
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.mark.slow
def test_a_wheel_runs_without_its_sources(tmp_path):
    sources = tmp_path / "sources"
    done("git", "clone", "--quiet", ROOT, sources, cwd=tmp_path)
    wheels, home = tmp_path / "wheels", tmp_path / "home"
    home.mkdir()
    pip = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
    done(*pip, "wheel", "--no-deps", "--wheel-dir", wheels, sources, cwd=tmp_path)
    (wheel,) = wheels.glob("brakebench-*.whl")
    tracked = subprocess.run(
        ["git", "-C", ROOT, "ls-files", "dbc", "ecu", "plant", "hil"], capture_output=True, text=True
    )
    assert set(tracked.stdout.split()) <= set(zipfile.ZipFile(wheel).namelist())
    done(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv", cwd=tmp_path)
    python = tmp_path / "venv" / "bin" / "python"
    (target,) = (tmp_path / "venv" / "lib").glob("python3*/site-packages")
    done(*pip, "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=tmp_path)
    # what it depends on is taken from here: its own installation stands first
    (target / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    brakebench = tmp_path / "venv" / "bin" / "brakebench"
    assert str(target) in done(python, "-c", "import hil; print(hil.__file__)", cwd=home)
    assert "stop72" in done(brakebench, "scenarios", cwd=home)
    assert "PASSED" in done(brakebench, "run", "stop72", "--virtual", "--out", "run", cwd=home)
    assert "uPlot" in (home / "run" / "report.html").read_text()
    assert "13,373 decoded" in done(brakebench, "decode", "sample:weak_brake", cwd=home)

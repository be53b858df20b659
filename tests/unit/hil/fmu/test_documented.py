"""The commands, the program and the map that docs/fmu.md shows."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from hil.cli.main import build_parser, main
from hil.fmu.plant_map import load_plant_map

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs" / "fmu.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_map_of_the_page(tmp_path):
    (text,) = blocks("toml")
    (tmp_path / "map.toml").write_text(text)
    found = load_plant_map(tmp_path / "map.toml")
    assert (found.step_s, found.parameters, found.wanted) == (0.005, {"mass": 1500.0}, ["speed"])
    assert len(found.inputs["brake_force"].terms) == 2
    assert found.outputs["WHEEL_SPEED_FRONT.WHEEL_SPEED_FL"].noise == 0.05


@pytest.mark.slow
def test_the_commands_and_the_program_of_the_page(tmp_path, monkeypatch, capsys):
    pytest.importorskip("fmpy", reason="FMUs are run with FMPy: pip install 'brakebench[fmu]'")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BRAKEBENCH_PYTHON", sys.executable)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    (shell, residuals), (program,) = blocks("sh"), blocks("python")
    commands = [shlex.split(line)[1:] for line in shell.splitlines()]
    assert len(commands) == 2
    for words in commands:
        assert main(words) == 0
    assert "car.fmu: FMI 3.0 co-simulation for Linux" in capsys.readouterr().out
    assert main(commands[0]) == 2  # it exists
    assert "--force" in capsys.readouterr().err
    assert build_parser(["explain"]).parse_args(shlex.split(residuals)[1:]).plant  # run in test_residuals
    names = {}
    exec(compile(program, "docs/fmu.md", "exec"), names)  # noqa: S102
    speed = names["result"]["TRUTH_MOTION.SPEED"]
    assert speed[0] == 25.0
    assert speed[-1] < 24.0

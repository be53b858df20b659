"""The examples, run as their documentation says."""

import json
import re
import sys
from pathlib import Path

import pytest
from processes import RUN_LIMIT_S, result_of

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
PYTHON = [sys.executable]


def stopped_within(start, *arguments):
    process = start(*arguments, program=PYTHON)
    out, err = process.communicate(timeout=RUN_LIMIT_S)
    assert process.returncode == 0, err
    return float(re.fullmatch(r"stopped within ([\d.]+) m\n", out)[1])


@pytest.mark.parametrize("name", ["own_ecu.py", "own_plant.py"])
def test_objects_in_virtual_time(start, name):
    assert 40.0 < stopped_within(start, str(EXAMPLES / name)) < 90.0


@pytest.mark.parametrize(
    ("role", "script"),
    [
        pytest.param("ecu", ["own_ecu.py", "{spec}"], marks=pytest.mark.slow),
        ("ecu", ["plain_ecu.py", "brakebench", "{name}"]),
        pytest.param("plant", ["own_plant.py", "{spec}"], marks=pytest.mark.slow),
    ],
)
def test_processes_of_ones_own(start, channel, short, role, script):
    words = {"spec": channel, "name": channel.removeprefix("loopback:")}
    bench = start("run", short, "--without", role, "--bus", channel, "--json", "--out", "out")
    own = start(str(EXAMPLES / script[0]), *(word.format(**words) for word in script[1:]), program=PYTHON)
    result = result_of(bench, (0, 4))
    assert own.poll() is None, own.communicate()
    print(script[0], json.dumps({k: result[k] for k in ("stop_distance_m", "frames_lost", "frames_corrupt")}))
    assert 3.0 < result["stop_distance_m"] < 90.0
    assert (result["processes"], result["frames_corrupt"]) == (1, 0)


def test_the_plain_script_stays_plain():
    text = (EXAMPLES / "plain_ecu.py").read_text()
    code = text.split('"""', 2)[2]
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 41
    assert not re.search(r"^(from|import) (hil|dbc|ecu|plant)", text, re.MULTILINE)


@pytest.mark.slow
def test_the_notebook_from_top_to_bottom(start, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    cells = json.loads((EXAMPLES / "recording.ipynb").read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    (tmp_path / "notebook.py").write_text("\n\n".join([*code, 'figure.savefig("drawn.png")']))
    process = start("notebook.py", program=PYTHON)
    out, err = process.communicate(timeout=550)  # `explain` alone takes minutes on a busy machine
    assert process.returncode == 0, err
    assert "Front left" in out
    assert (tmp_path / "drawn.png").stat().st_size > 10_000
    assert (tmp_path / "found" / "extension.toml").exists()

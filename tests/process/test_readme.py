"""The README's run command, as a newcomer pastes it."""

import os
import re
import shutil
import subprocess
import uuid
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOT_COPIED = shutil.ignore_patterns(".git", ".venv*", "runs", "build", "*.egg-info", "__pycache__", ".*_cache")


def commands():
    """Lines of the README's shell blocks."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


def test_the_readme_leads_with_two_commands():
    run, test = commands()[:2]
    assert run.endswith("brakebench run")
    assert "pytest" in test


@pytest.mark.slow
def test_the_run_command_works_on_a_bare_machine(tmp_path):
    copy = tmp_path / "brakebench"
    shutil.copytree(ROOT, copy, ignore=NOT_COPIED)
    # loopbacks of its own, so that other benches of this machine do not matter
    runtime = tmp_path / uuid.uuid4().hex[:6]
    runtime.mkdir(mode=0o700)
    env = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH", "PYTEST_CURRENT_TEST")}
    done = subprocess.run(
        ["bash", "-euc", commands()[0]],
        cwd=copy,
        env=env | {"XDG_RUNTIME_DIR": str(runtime)},
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "PASSED" in done.stdout
    assert re.search(r"Stopping distance +6\d\.\d+ +m", done.stdout)
    assert (copy / "runs" / "stop72" / "recording.log").stat().st_size > 500_000

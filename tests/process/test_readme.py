"""The README leads with two commands; `.ci/run` runs both in a clone, as a newcomer pastes them."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def commands():
    """Lines of the README's shell blocks."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


def test_the_readme_leads_with_two_commands():
    run, test = commands()[:2]
    assert run.startswith("python3 -m venv ")
    assert run.endswith("brakebench run")
    assert test.startswith("python3 -m venv ")
    assert "pytest" in test

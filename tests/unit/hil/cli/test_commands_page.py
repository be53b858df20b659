"""docs/commands.md is what the parsers say now."""

from pathlib import Path

from hil.cli.commands_page import page
from hil.cli.main import COMMANDS

PAGE = Path(__file__).parents[4] / "docs" / "commands.md"


def test_the_page_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python -m hil.cli.commands_page"


def test_every_command_has_its_part():
    text = page()
    assert [line for line in text.splitlines() if line.startswith("## ")] == [f"## brakebench {c}" for c in COMMANDS]
    assert "| `--out DIR` |" in text
    assert "### brakebench diag read-dtc" in text
    assert "%(" not in text

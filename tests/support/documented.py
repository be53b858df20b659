"""What the documentation shows, for tests that run it."""

from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
MOTOR_LOSS = DOCS.joinpath("testing.md").read_text().split("```python\n")[1].split("```")[0]
"""The first test of docs/testing.md."""

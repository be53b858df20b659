"""A digest of sources changes with what they mean and with nothing else."""

from pathlib import Path

import pytest

from hil.validation.blind_trials.sources import digest, state

BEFORE = '''"""A document."""

FACTOR = 2.0
"""What it is."""


def law(speed_mps: float) -> float:
    """Another."""
    return FACTOR * speed_mps  # in newtons
'''
AFTER = """FACTOR = 2.0
def law(speed_mps: float) -> float:
    return (FACTOR
            * speed_mps)
"""


def _folder(tmp_path: Path) -> Path:
    folder = tmp_path / "shown"
    (folder / "inner").mkdir(parents=True)
    (folder / "law.py").write_text(BEFORE)
    (folder / "inner" / "car.toml").write_text("mass_kg = 1500.0\n")
    return folder


def test_words_and_layout_change_nothing(tmp_path):
    folder = _folder(tmp_path)
    before = digest([folder])
    (folder / "law.py").write_text(AFTER)
    (folder / "notes.md").write_text("no source")
    assert digest([folder]) == before


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("law.py", BEFORE.replace("2.0", "3.0")),
        ("law.py", BEFORE.replace('"""What it is."""', "law = FACTOR")),
        ("inner/car.toml", "mass_kg = 1600.0\n"),
        ("inner/added.py", ""),
    ],
)
def test_a_changed_source_changes_the_digest(tmp_path, file, text):
    folder = _folder(tmp_path)
    before = digest([folder])
    (folder / file).write_text(text)
    assert digest([folder]) != before


def test_a_source_that_moves_changes_the_digest(tmp_path):
    folder = _folder(tmp_path)
    before = digest([folder])
    (folder / "law.py").rename(folder / "inner" / "law.py")
    assert digest([folder]) != before


def test_what_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file or folder"):
        digest([tmp_path / "absent"])


def test_the_state_has_twelve_digits_and_stays():
    assert len(state()) == 12
    assert state() == state()

"""A digest of sources changes with them and with nothing else."""

from hil.validation.blind_trials.sources import HIDDEN, SOURCES, STUDIED, state
from plant.compiled import digest


def test_a_changed_source_changes_the_digest(tmp_path, monkeypatch) -> None:
    package = tmp_path / "shown"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "law.py").write_text("A = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = digest(("shown",))
    (package / "notes.txt").write_text("no source")
    assert digest(("shown",)) == before
    (package / "law.py").write_text("A = 2\n")
    assert digest(("shown",)) != before


def test_the_state_is_that_of_study_and_hidden_car() -> None:
    assert state() == digest(STUDIED + HIDDEN, SOURCES)[:12]
    assert digest(STUDIED) != digest(HIDDEN)

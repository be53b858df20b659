import json

import pytest

from hil.errors import BrakebenchError
from hil.validation.reproduce import store, study
from hil.validation.reproduce.cases import CASES
from hil.validation.reproduce.conditions import CONDITIONS
from hil.validation.reproduce.store import Store, sources


def here(batches, function, workers):
    """What an engine does, in this process."""
    return ((batch, [function(item) for item in batch]) for batch in batches)


def test_a_stopped_measurement_goes_on_where_it_was(tmp_path, monkeypatch):
    driven = []
    keys = {claim.key for claim in study.CLAIMS} | {claim.paper_key for claim in study.CLAIMS}

    def job(what, extension):
        if len(driven) == 5:
            raise KeyboardInterrupt
        driven.append(what)
        return dict.fromkeys(keys, float(what[2]))

    monkeypatch.setattr(study, "work", here)
    monkeypatch.setattr(study, "job", job)
    path = tmp_path / "numbers.jsonl"
    with pytest.raises(KeyboardInterrupt):
        study.measure(2, 1, lambda _: None, Store(path))
    assert len(Store(path).numbers) == 5
    path.write_text(path.read_text() + '["estim', encoding="utf-8")  # killed while writing
    monkeypatch.setattr(
        study, "job", lambda what, extension: driven.append(what) or dict.fromkeys(keys, float(what[2]))
    )
    said = []
    rows = study.measure(2, 1, said.append, Store(path))
    assert said[0] == f"5 of {2 * len(CASES) * len(CONDITIONS)} cases were driven before"
    assert len(driven) == len(set(driven)) == 2 * len(CASES) * len(CONDITIONS)
    assert {(row.seeds, row.median) for row in rows} == {(2, 1.5)}


def test_numbers_of_other_sources_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "numbers.jsonl"
    Store(path).add(("patch", 0, 1), {"a": 1.0})
    assert Store(path).numbers == {("patch", 0, 1): {"a": 1.0}}
    monkeypatch.setattr(store, "sources", lambda: "other")
    with pytest.raises(BrakebenchError, match="other sources"):
        Store(path)


def test_numbers_of_another_car_are_refused(tmp_path):
    path, extension = tmp_path / "numbers.jsonl", tmp_path / "extension.toml"
    extension.write_text("[effects.mass_offset]\nmass_kg = 100.0\n")
    Store(path, extension).add(("patch", 1, 1), {"a": 1.0})
    assert Store(path, extension).numbers == {("patch", 1, 1): {"a": 1.0}}
    with pytest.raises(BrakebenchError, match="other sources"):
        Store(path)
    extension.write_text("[effects.mass_offset]\nmass_kg = 200.0\n")
    with pytest.raises(BrakebenchError, match="other sources"):
        Store(path, extension)


@pytest.mark.parametrize("text", ["nothing of ours\n", json.dumps({"sources": sources()}) + "\n[1]\n", ""])
def test_files_that_are_none_of_ours_are_refused(tmp_path, text):
    path = tmp_path / "numbers.jsonl"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BrakebenchError, match="no file of measured numbers"):
        Store(path)
    with pytest.raises(BrakebenchError, match="cannot be used"):
        Store(tmp_path / "no" / "such")

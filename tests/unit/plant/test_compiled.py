"""An edited submodel must not meet a compiled model of yesterday."""

import shutil
from importlib import resources
from pathlib import Path

import pytest

from plant import compiled
from plant.model import simulate


def test_stamp_changes_with_every_source(tmp_path, monkeypatch):
    with resources.as_file(resources.files("plant")) as folder:
        shutil.copytree(folder, tmp_path / "plant", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(compiled.resources, "files", lambda package: tmp_path.joinpath(*package.split(".")))
    stamp = compiled._source_stamp.__wrapped__
    assert stamp() == stamp()
    seen = {stamp()}
    compiles = "from plant.compiled import"
    sources = [f for f in (tmp_path / "plant").rglob("*.py") if compiles in f.read_text()]
    sources += [tmp_path / "plant" / "vectors.py", tmp_path / "plant" / "parameters" / "tyre.py"]
    for file in sources:
        Path(file).write_text(file.read_text() + "\n# edited\n")
        assert stamp() not in seen, f"an edit of {file.name} would not be noticed"
        seen.add(stamp())
    assert len(sources) > 10


def test_the_entry_point_carries_the_stamp():
    cache = getattr(simulate, "_cache", None)
    if cache is None:
        pytest.skip("numba is switched off: nothing is cached")
    assert cache._cache_file._source_stamp == compiled._source_stamp()

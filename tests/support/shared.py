"""Answers that several tests look at: one worker computes each, the others wait for it and read it."""

import fcntl
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Shared = Callable[[str, Callable[[Path], Any]], Any]


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Shared:
    """What ``make(folder)`` returns, as JSON keeps it: called once a session for each name, with its own folder."""
    base = tmp_path_factory.getbasetemp()
    session = base.parent if hasattr(request.config, "workerinput") else base  # workers have a folder each, inside

    def answer(name: str, make: Callable[[Path], Any]) -> Any:
        folder = session / "shared" / name
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            file = folder / "answer.json"
            if not file.exists():
                text = json.dumps(make(folder))
                file.write_text(text, "utf-8")
            return json.loads(file.read_text("utf-8"))

    return answer

"""The answers on record: names, verdicts and rivals exactly, numbers as far as the same code repeats them.

A change that is meant to leave the answers alone is held to it here; one that is meant to change them records them anew
(``record.py``) and passes the drawn cases. Numbers are compared to 1e-6 of their scale, or to five times what the code
on record itself moves them from build to build: code that is compiled for another processor, or loaded instead of
compiled, rounds the last bits otherwise, and a fit ends elsewhere within its own tolerance.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pinned import CASES, HERE, family, group, recorded, scales

RELATIVE, BUILDS = 1e-6, 5.0

pytestmark = [pytest.mark.slow]


@pytest.mark.parametrize("case", CASES)
def test_the_answer_is_the_one_on_record(case: str, tmp_path: Path) -> None:
    into = tmp_path / "answer.json"
    subprocess.run([sys.executable, HERE / "record.py", "--into", into, case], check=True)
    now, (then, spread) = json.loads(into.read_text(encoding="utf-8")), recorded(case)
    assert now.keys() == then.keys()
    scale = scales(then)
    moved = {
        path: (value, now[path])
        for path, value in then.items()
        if (
            abs(now[path] - value) > scale[family(path)] * max(RELATIVE, BUILDS * spread.get(group(path), 0.0))
            if isinstance(value, float) and isinstance(now[path], float)
            else now[path] != value
        )
    }
    assert not moved

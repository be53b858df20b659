"""The answers on record: names, verdicts and rivals exactly, numbers to 1e-6 relative.

A change that is meant to leave the answers alone is held to it here; one that is meant to change them records them anew
(``record.py``) and passes the drawn cases.
"""

import json
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from pinned import CASES, HERE, recorded

RELATIVE = 1e-6 if platform.machine() == "x86_64" else 1e-3
"""Records are of an x86-64 processor with AVX2; others round the last bits otherwise."""
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


@pytest.mark.parametrize("case", CASES)
def test_the_answer_is_the_one_on_record(case: str, tmp_path: Path) -> None:
    into = tmp_path / "answer.json"
    subprocess.run([sys.executable, HERE / "record.py", "--into", into, case], check=True)
    now, expected = json.loads(into.read_text(encoding="utf-8")), recorded(case)
    assert now.keys() == expected.keys()
    moved = {path: (expected[path], value) for path, value in now.items() if not _same(expected[path], value)}
    assert not moved


def _same(then: object, now: object) -> bool:
    if isinstance(then, float) and isinstance(now, float):
        return now == pytest.approx(then, rel=RELATIVE, abs=1e-12)
    return then == now

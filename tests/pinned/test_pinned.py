"""The answers on record: names, verdicts and rivals exactly, numbers to 1e-6 relative.

A change that is meant to leave the answers alone is held to it here; one that is meant to change them records them anew
(``record.py``) and passes the drawn cases.
"""

from pathlib import Path

import pytest
from pinned import CASES, answer, flat, recorded

RELATIVE = 1e-6
pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.mark.parametrize("case", CASES)
def test_the_answer_is_the_one_on_record(case: str, tmp_path: Path) -> None:
    expected = recorded(case)
    now = {path: value for path, _, value in flat(answer(case, tmp_path))}
    assert now.keys() == expected.keys()
    moved = {path: (expected[path], value) for path, value in now.items() if not _same(expected[path], value)}
    assert not moved


def _same(then: object, now: object) -> bool:
    if isinstance(then, float) and isinstance(now, float):
        return now == pytest.approx(then, rel=RELATIVE, abs=1e-12)
    return then == now

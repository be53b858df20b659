"""Files of compiled code that a power cut left empty or short."""

from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

import dbc.compiled
import ecu.law.compiled
import hil.diagnosis.compiled
import hil.log.compiled
import plant.compiled

WAYS = {
    "dbc": dbc.compiled.compiled,
    "ecu": ecu.law.compiled.entry,
    "plant": plant.compiled.entry,
    "log": hil.log.compiled.compiled,
    "diagnosis": hil.diagnosis.compiled.compiled,
}
pytestmark = pytest.mark.skipif(plant.compiled.INTERPRETED, reason="numba is switched off")


def _compiled(source: Path, way: Callable[[Any], Any]) -> Any:
    """The function as a new process has it: nothing of it is in memory."""
    spec = spec_from_file_location("of_the_user", source)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return way(module.twice)


def _from_disk(function: Any) -> bool:
    assert function(2.0) == 4.0
    return bool(function.stats.cache_hits)


@pytest.mark.parametrize("left", [0.0, 0.5])
@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("way", WAYS)
def test_what_cannot_be_read_is_compiled_and_kept_anew(tmp_path: Path, way: str, ending: str, left: float) -> None:
    source = tmp_path / "of_the_user.py"
    source.write_text("def twice(x):\n    return 2.0 * x\n", encoding="ascii")
    assert not _from_disk(_compiled(source, WAYS[way]))
    assert _from_disk(_compiled(source, WAYS[way]))
    (broken,) = tmp_path.rglob(f"*{ending}")
    whole = broken.read_bytes()
    broken.write_bytes(whole[: int(left * len(whole))])
    assert not _from_disk(_compiled(source, WAYS[way]))
    assert _from_disk(_compiled(source, WAYS[way]))

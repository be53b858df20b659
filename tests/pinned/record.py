"""Answers of the pinned cases: ``python tests/pinned/record.py [CASE...]`` writes the records anew.

Do so where the engine changes on purpose: look at what moves, empty ``keys.toml``, commit the records with the change.
``--into FILE CASE`` writes the answer of one case there. Machine code, numpy and BLAS are those of one processor type
(AVX2 and FMA, no AVX-512), so that records hold on others. A record has each case three times: as compiled, as loaded
from the cache, and as compiled for the processor at hand; the spread of the three is what no test can see below.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

PROCESSOR = {
    "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
}  # fmt: skip
if "--host" not in sys.argv:
    os.environ |= PROCESSOR
sys.path.insert(0, str(Path(__file__).parent.parent / "support"))

from pinned import CASES, RECORDS, answer, flat, spread  # noqa: E402 - after the environment and the path are set


def _answer(case: str) -> dict[str, Any]:
    with TemporaryDirectory() as folder:
        return {path: value for path, _, value in flat(answer(case, Path(folder)))}


def _run(case: str, cache: Path, *options: str) -> dict[str, Any]:
    """The answer of a process of its own, with its machine code in a folder."""
    into = cache / "answer.json"
    command = [sys.executable, __file__, "--into", str(into), case, *options]
    own = {name: value for name, value in os.environ.items() if name not in PROCESSOR}
    subprocess.run(command, check=True, env=own | {"NUMBA_CACHE_DIR": str(cache)})
    return dict(json.loads(into.read_text(encoding="utf-8")))


def main(arguments: list[str]) -> None:
    """Record the cases named, or all; or write the answer of one into a file."""
    if arguments[:1] == ["--into"]:
        Path(arguments[1]).write_text(json.dumps(_answer(arguments[2])), encoding="utf-8")
        return
    for case in arguments or CASES:
        with TemporaryDirectory() as one, TemporaryDirectory() as other:
            runs = [_run(case, Path(one)), _run(case, Path(one)), _run(case, Path(other), "--host")]
        content = {"spread": spread(runs), "values": runs[0]}
        (RECORDS / f"{case}.json").write_text(json.dumps(content, indent=0) + "\n", encoding="utf-8")
        print(case, runs[0]["/answer/verdict"], len(runs[0]), "values")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Answers of the pinned cases: ``python tests/pinned/record.py [CASE...]`` writes the records anew.

Do so where the engine changes on purpose: look at what moves, empty ``keys.toml``, commit the records with the change.
``--into FILE CASE`` writes the answer of one case there; the tests use that. Machine code, numpy and BLAS are those of
one processor type (AVX2 and FMA, no AVX-512): between types the last bits differ, and an optimum by up to 3e-4.
"""

import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ |= {
    "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
}  # fmt: skip
sys.path.insert(0, str(Path(__file__).parent.parent / "support"))

from pinned import CASES, RECORDS, answer, flat


def _answer(case: str) -> dict[str, Any]:
    with TemporaryDirectory() as folder:
        return {path: value for path, _, value in flat(answer(case, Path(folder)))}


def main(arguments: list[str]) -> None:
    """Record the cases named, or all; or write the answer of one into a file."""
    if arguments[:1] == ["--into"]:
        Path(arguments[1]).write_text(json.dumps(_answer(arguments[2])), encoding="utf-8")
        return
    for case in arguments or CASES:
        content = _answer(case)
        (RECORDS / f"{case}.json").write_text(json.dumps(content, indent=0) + "\n", encoding="utf-8")
        print(case, content["/answer/verdict"], len(content), "values")


if __name__ == "__main__":
    main(sys.argv[1:])

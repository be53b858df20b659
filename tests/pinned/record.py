"""Write the records anew: ``python tests/pinned/record.py [CASE...]``.

Do so where the engine changes on purpose: look at what moves, empty ``keys.toml``, commit the records with the change.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "support"))

from pinned import CASES, RECORDS, answer, flat  # noqa: E402


def main() -> None:
    """Record the cases named, or all."""
    for case in sys.argv[1:] or CASES:
        with TemporaryDirectory() as folder:
            content = {path: value for path, _, value in flat(answer(case, Path(folder)))}
        (RECORDS / f"{case}.json").write_text(json.dumps(content, indent=0) + "\n", encoding="utf-8")
        print(case, content["/answer/verdict"], len(content), "values")


if __name__ == "__main__":
    main()

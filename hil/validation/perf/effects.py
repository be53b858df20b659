"""What all effects cost a step while they are neutral: beside the build that has none."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable

from hil.validation.perf.row import Row, paired
from plant.integrate import RUNGE_KUTTA_4, SEMI_IMPLICIT

PAIRS = 5
_CHILD = (
    "import sys; from hil.validation.perf.plant import per_step_ns; "
    "print(min(per_step_ns(int(sys.argv[1])) for _ in range(5)))"
)


def without_ns(method: int, folder: str) -> float:
    """Time of one step, ns, in a process with effects compiled out; compiled code is kept in ``folder``."""
    environment = os.environ | {"BRAKEBENCH_EFFECTS": "0", "NUMBA_CACHE_DIR": folder}
    done = subprocess.run(
        [sys.executable, "-c", _CHILD, str(method)], capture_output=True, text=True, check=True, env=environment
    )
    return float(done.stdout)


def measure(per_step_ns: Callable[[int], float]) -> list[Row]:
    """Rows of both methods; the ratio is above 1 / 1.3 while neutral effects cost less than 30 %."""
    with tempfile.TemporaryDirectory() as folder:
        for method in (SEMI_IMPLICIT, RUNGE_KUTTA_4):
            without_ns(method, folder)  # compiles
        return [
            paired(
                f"{name}, all effects neutral",
                # mypy infers no type for a default of a lambda, which binds what this turn of the loop has
                lambda m=method: min(per_step_ns(m) for _ in range(5)),  # type: ignore[misc]
                lambda m=method: without_ns(m, folder),  # type: ignore[misc]
                "effects compiled out",
                "ns/step",
                pairs=PAIRS,
            )
            for name, method in (("semi-implicit", SEMI_IMPLICIT), ("RK4", RUNGE_KUTTA_4))
        ]

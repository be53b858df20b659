"""Compilation of loops over samples: cached on disk, without the global interpreter lock."""

import os
from collections.abc import Callable
from typing import Any, cast

from numba import njit

WORKERS = len(os.sched_getaffinity(0))
"""Number of threads that run compiled loops in parallel: one per available processor."""
compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], njit(cache=True, nogil=True, error_model="numpy"))
"""Decorator of a loop."""

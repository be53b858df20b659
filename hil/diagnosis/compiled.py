"""Compilation of loops over samples: cached on disk, without the global interpreter lock."""

import os
from collections.abc import Callable
from typing import Any, cast

from dbc.compile_cache import cached

WORKERS = len(os.sched_getaffinity(0))
"""Number of threads that run compiled loops in parallel: one per available processor."""
compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], cached)
"""Decorator of a loop."""

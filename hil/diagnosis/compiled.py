"""How loops over samples are compiled: cached on disk, without the global interpreter lock."""

import os
from collections.abc import Callable
from typing import Any, cast

from numba import njit

WORKERS = len(os.sched_getaffinity(0))
"""Threads that run such loops side by side."""
compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], njit(cache=True, nogil=True, error_model="numpy"))

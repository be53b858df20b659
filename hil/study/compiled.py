"""How loops over samples are compiled: cached on disk, without the global interpreter lock."""

from collections.abc import Callable
from typing import Any, cast

from numba import njit

compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], njit(cache=True, nogil=True, error_model="numpy"))

"""What the compiled loops over messages share; ``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numba import njit

from dbc.e2e import CRC_TABLE

PAYLOAD = 8  # bytes set aside for each message
CRC = np.array(CRC_TABLE, dtype=np.int64)
compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], njit(cache=True, nogil=True, error_model="numpy"))
"""Decorator of a loop: cached on disk, without the global interpreter lock, with Python's rounding."""

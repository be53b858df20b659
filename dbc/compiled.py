"""What the compiled loops over messages share; ``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled."""

from collections.abc import Callable
from functools import partial
from struct import Struct
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dbc.compile_cache import cached
from dbc.e2e import CRC_TABLE

PAYLOAD = 8  # bytes set aside for each message
CRC = np.array(CRC_TABLE, dtype=np.int64)
compiled = cast(Callable[[Callable[..., Any]], Callable[..., Any]], cached)
"""Decorator of a loop: cached on disk, without the global interpreter lock, with Python's rounding."""


def writer(values: NDArray[np.float64], first: int = 0, last: int | None = None) -> Callable[..., None]:
    """What writes its arguments, all numbers, into a part of a vector: the fastest way there from Python."""
    number = len(values[first:last])
    return partial(Struct(f"{number}d").pack_into, values.data.cast("B"), values.itemsize * first)

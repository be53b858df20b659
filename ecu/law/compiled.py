"""How the numeric kernels are compiled: cached on disk; ``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled.

Each kernel keeps its constants and helpers in one file, because numba's cache looks at the age of one file only.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a function of scalars and arrays when it is first called."""
    return cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))

"""Compilation of the equations of hidden cars: cached on disk."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """A function of numbers and arrays, compiled."""
    return cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))

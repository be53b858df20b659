"""How the reference car is compiled: equations inlined into one cached entry point."""

import hashlib
from collections.abc import Callable
from functools import cache
from importlib import resources
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def equation(function: F) -> F:
    """Compile a function into its callers."""
    return cast(F, njit(error_model="numpy", inline="never")(function))


def entry(function: F) -> F:
    """Compile a function that Python calls; the cache on disk is renewed when any file of this room changes."""
    compiled = njit(cache=True, nogil=True, error_model="numpy")(function)
    stored = getattr(compiled, "_cache", None)  # absent when numba is switched off
    if stored is not None:
        stored._cache_file._source_stamp = _source_stamp()
    return cast(F, compiled)


@cache
def _source_stamp() -> str:
    digest = hashlib.sha256()
    for file in sorted(resources.files("hil.validation.reference_car").iterdir(), key=lambda f: f.name):
        if file.name.endswith(".py"):
            digest.update(file.read_bytes())
    return digest.hexdigest()

"""How the numeric kernels are compiled: helpers into a few entry points, which are cached on disk.

``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled. Numba's cache looks at the age of one file only, so an edited
helper or layout would leave a stale entry point behind; `entry` stamps the cache with all sources instead.
"""

import hashlib
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from importlib import resources
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.extending import register_jitable
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., Any])


def helper(function: F) -> F:
    """Compile a function of scalars and arrays into whatever calls it, when an entry point first needs it."""
    return cast(F, njit(nogil=True, error_model="numpy")(function))


def shared(function: F) -> F:
    """Leave a function to Python as it is, and let compiled functions call it, too.

    Parameters of it that are a parameter set are then a `record` of it.
    """
    return register_jitable(error_model="numpy")(function)


def record(parameters: Any) -> NDArray[np.void]:
    """Plain numbers of a parameter set by name, as compiled functions take them; shape (1,)."""
    values = {f.name: getattr(parameters, f.name) for f in fields(parameters)}
    numbers = {name: float(value) for name, value in values.items() if isinstance(value, (bool, int, float))}
    return np.array([tuple(numbers.values())], np.dtype((np.record, [(name, "f8") for name in numbers])))


def entry(function: F) -> F:
    """Compile a function that Python calls: cached on disk, without the global interpreter lock."""
    compiled = njit(cache=True, nogil=True, error_model="numpy")(function)
    disk_cache = getattr(compiled, "_cache", None)  # absent when numba is switched off
    if disk_cache is not None:
        disk_cache._cache_file._source_stamp = _source_stamp()
    return cast(F, compiled)


@cache
def _source_stamp() -> str:
    """Digest of every source file of the control law."""
    digest = hashlib.sha256()
    for folder in ("ecu.law", "ecu.law.joint", "ecu.law.plausibility"):
        for file in sorted(resources.files(folder).iterdir(), key=lambda f: f.name):
            if file.name.endswith(".py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()

"""How the numeric kernels are compiled: helpers into a few entry points, which are cached on disk.

``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled. Numba's cache looks at the age of one file only, so an edited
helper or layout would leave a stale entry point behind; `entry` stamps the cache with all sources instead.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from importlib import resources
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np
from numba import njit
from numba.extending import register_jitable

from dbc.compile_cache import cached

F = TypeVar("F", bound=Callable[..., Any])


def helper(function: F) -> F:
    """Compile a function of scalars and arrays into whatever calls it, when an entry point first needs it."""
    return cast(F, njit(nogil=True, error_model="numpy")(function))


def shared(function: F) -> F:
    """Leave a function to Python as it is, and let compiled functions call it, too.

    Parameters of it that are a parameter set are then a record of it (`record_of`).
    """
    return register_jitable(error_model="numpy")(function)


def record_of(kind: type[Any]) -> np.dtype[np.void]:
    """How compiled functions see a parameter set: its plain numbers by name, in their order."""
    return np.dtype((np.record, [(name, "f8") for name, t in get_type_hints(kind).items() if t in (float, int, bool)]))


def numbers(parameters: Any) -> list[float]:
    """Plain numbers of a parameter set, in the order of `record_of`."""
    return [float(getattr(parameters, name)) for name in record_of(type(parameters)).names or ()]


def entry(function: F) -> F:
    """Compile a function that Python calls: cached on disk, without the global interpreter lock."""
    return cached(function, _source_stamp())


@cache
def _source_stamp() -> str:
    """Digest of every source file of the control law."""
    digest = hashlib.sha256()
    for folder in ("ecu.law", "ecu.law.joint", "ecu.law.plausibility"):
        for file in sorted(resources.files(folder).iterdir(), key=lambda f: f.name):
            if file.name.endswith(".py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()

"""How the plant is compiled: equations are inlined into a few cached entry points.

Products and sums may be fused (``contract``); no other liberty is taken with floating point.

``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled. Numba's cache looks at the age of one file only, so an edited
submodel or a changed layout would leave a stale entry point behind; `entry` stamps the cache with all sources instead.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache
from importlib import resources
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])
EFFECTS = os.environ.get("BRAKEBENCH_EFFECTS", "1") != "0"
"""False compiles the effects out: the build that the neutral one is compared with."""


def equation(function: F) -> F:
    """Compile a function into whatever calls it, when an entry point first needs it."""
    return cast(F, njit(error_model="numpy", fastmath={"contract"}, forceinline=True)(function))


def section(function: F) -> F:
    """Paste a function into its caller before compiling: for long functions with one caller."""
    return cast(F, njit(error_model="numpy", fastmath={"contract"}, inline="always")(function))


def block(function: F) -> F:
    """Compile a function that stays one piece of code however many call it."""
    return cast(F, njit(error_model="numpy", fastmath={"contract"})(function))


def entry(function: F) -> F:
    """Compile a function that Python calls: cached on disk, without the global interpreter lock."""
    compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function)
    disk_cache = getattr(compiled, "_cache", None)  # absent when numba is switched off
    if disk_cache is not None:
        disk_cache._cache_file._source_stamp = _source_stamp()
    return cast(F, compiled)


@cache
def _source_stamp() -> str:
    """Digest of every source file of the plant."""
    digest = hashlib.sha256(b"effects" if EFFECTS else b"")
    for folder in ("plant", "plant.parameters", "plant.effects", "plant.effects.sensing"):
        for file in sorted(resources.files(folder).iterdir(), key=lambda f: f.name):
            if file.name.endswith(".py"):
                digest.update(file.read_bytes())
    return digest.hexdigest()

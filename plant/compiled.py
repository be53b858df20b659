"""How the plant is compiled: equations are inlined into a few cached entry points.

Products and sums may be fused (``contract``), a quotient be a product with the reciprocal (``arcp``), and a zero have
either sign (``nsz``); no other liberty is taken with floating point.

``NUMBA_DISABLE_JIT=1`` runs the same source uncompiled. Numba's cache looks at the age of one file only, so an edited
submodel or a changed layout would leave a stale entry point behind; `entry` stamps the cache with all sources instead.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from importlib import resources
from typing import Any, TypeVar, cast

import numba

from dbc.compile_cache import cached

F = TypeVar("F", bound=Callable[..., Any])
PACKAGES = (
    "plant", "plant.parameters", "plant.injection", "plant.effects", "plant.effects.road_air", "plant.effects.chassis",
    "plant.effects.tyres", "plant.effects.pads", "plant.effects.hydraulics", "plant.effects.motors",
    "plant.effects.sensing",
)  # fmt: skip
"""Where the plant's sources are."""
EFFECTS = os.environ.get("BRAKEBENCH_EFFECTS", "1") != "0"
"""False compiles the effects out: the build that the neutral one is compared with."""
_nb: Any = numba  # whose options are declared in part
INTERPRETED = bool(_nb.config.DISABLE_JIT)
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "arcp", "nsz"}}
_BORROWED = _OPTIONS | {"_nrt": False}
"""For what allocates nothing: vectors are the caller's, and nobody counts references to them."""


class Equation:
    """A function for other compiled functions: made without what only Python needs.

    Python may call it all the same, in tests and for starting values; then it is compiled once more, alone.
    """

    def __init__(self, function: Callable[..., Any], **how: Any) -> None:
        self.py_func = function
        self._how = _BORROWED | how
        self._lean = _nb.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **self._how)(function)
        self._numba_type_ = self._lean._numba_type_  # what the compiler takes this object for

    @cached_property
    def _alone(self) -> Callable[..., Any]:
        return cast(Callable[..., Any], _nb.njit(**self._how)(self.py_func))

    def __call__(self, *values: Any) -> Any:
        """The function's value, compiled."""
        return self._alone(*values)


def _equation(function: F, **how: Any) -> F:
    return function if INTERPRETED else cast(F, update_wrapper(Equation(function, **how), function))


def equation(function: F) -> F:
    """Compile a function into whatever calls it, when an entry point first needs it."""
    return _equation(function, forceinline=True)


def unfused(function: F) -> F:
    """As `equation`, but no product of the function is fused with what stands before or behind it."""
    return _equation(function, forceinline=True, fastmath=False)


def section(function: F) -> F:
    """Paste a function into its caller before compiling: for functions with one caller."""
    return cast(F, _nb.njit(inline="always", **_OPTIONS)(function))


def block(function: F) -> F:
    """Compile a function that stays one piece of code however many call it."""
    return _equation(function)


def entry(function: F) -> F:
    """Compile a function that Python calls: cached on disk, without the global interpreter lock."""
    return _entry(function, _OPTIONS)


def borrowing_entry(function: F) -> F:
    """As `entry`, for what allocates nothing: all vectors are the caller's, and nobody counts references to them."""
    return _entry(function, _BORROWED)


def exact_entry(function: F) -> F:
    """As `entry`, but nothing is fused: every product and sum is rounded as Python does it."""
    return _entry(function, _OPTIONS | {"fastmath": False})


def _entry(function: F, options: dict[str, Any]) -> F:
    return cached(function, _source_stamp(), **options)


def digest(packages: tuple[str, ...], endings: tuple[str, ...] = (".py",)) -> str:
    """SHA-256 of the source files of packages, their folders alone, in hexadecimal digits."""
    found = hashlib.sha256()
    for package in packages:
        for file in sorted(resources.files(package).iterdir(), key=lambda item: item.name):
            if file.name.endswith(endings):
                found.update(file.read_bytes())
    return found.hexdigest()


@cache
def _source_stamp() -> str:
    """Digest of every source file of the plant, and of which build it is."""
    return digest(PACKAGES) + (" with effects" if EFFECTS else "")

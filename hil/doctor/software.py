"""Python, packages, and the compiled plant."""

import os
import platform
import re
import shlex
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from typing import Any

from hil.doctor.line import Line, Status
from hil.extras import pip_install

SHOWN = ("numpy", "numba", "python-can", "cantools")


def software_lines() -> list[Line]:
    """Python and packages."""
    return [packages_line(requires("brakebench") or []), mdf_line(find_spec("asammdf") is not None)]


def packages_line(requirements: list[str]) -> Line:
    """Versions, and requirements that are not installed.

    Parameters
    ----------
    requirements : as in the distribution's metadata; those of extras are passed over.
    """
    needed = [match[0] for text in requirements if "extra ==" not in text and (match := re.match(r"[\w.-]+", text))]
    missing = [name for name in needed if _version(name) is None]
    found = [f"Python {platform.python_version()}"] + [f"{name} {_version(name)}" for name in SHOWN if _version(name)]
    if missing:
        finding = f"{', '.join(found)}; not installed: {', '.join(missing)}"
        return Line("packages", Status.MISSING, finding, _pip(*missing))
    return Line("packages", Status.OK, ", ".join(found))


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _pip(*names: str) -> str:
    return shlex.join([sys.executable, "-m", "pip", "install", *names])


def mdf_line(present: bool) -> Line:
    """Whether all commands read MF4 logs: ``explain`` reads them by asammdf, the others by themselves."""
    if present:
        return Line("MF4 logs", Status.OK, "read by every command (asammdf for explain)")
    return Line(
        "MF4 logs", Status.MISSING, "explain needs asammdf for them; every other command works", pip_install("mdf")
    )


def compiled_line() -> Line:
    """Whether all compiled code is on disk for this processor: else the next start compiles it first."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        finding = "numba is switched off: far too slow for real time"
        return Line("compiled code", Status.WARNING, finding, "unset NUMBA_DISABLE_JIT")
    try:
        for name in ("ecu.node", "plant.node"):
            import_module(name)
    except RuntimeError as error:  # numba finds no place where it can write
        return Line("compiled code", Status.MISSING, str(error), 'export NUMBA_CACHE_DIR="$HOME/.cache/numba"')
    entries = _cached_functions()
    missing = sorted(name for name, function in entries.items() if not _on_disk(function))
    folders = sorted({function._cache.cache_path for function in entries.values()})
    if missing:
        finding = f"to be compiled at first use (up to half a minute): {', '.join(missing)}"
        return Line("compiled code", Status.WARNING, finding, "brakebench run --out $(mktemp -d)")
    return Line("compiled code", Status.OK, f"{', '.join(sorted(entries))} on disk in {', '.join(folders)}")


def _cached_functions() -> dict[str, Any]:
    """Functions of plant and ECU that numba keeps on disk."""
    found: dict[str, Any] = {}
    for module in [sys.modules[name] for name in sorted(sys.modules) if name.split(".")[0] in ("ecu", "plant")]:
        for value in vars(module).values():
            if hasattr(getattr(value, "_cache", None), "_cache_file"):
                found[f"{value.py_func.__module__}.{value.py_func.__name__}"] = value
    return found


def _on_disk(function: Any) -> bool:
    """Whether its cache holds this source (numba checks the stamp) for this processor."""
    processor = function.targetctx.codegen().magic_tuple()
    return any(key[1] == processor for key in function._cache._cache_file._load_index())

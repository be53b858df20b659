"""The command that installs what an extra of this package needs."""

import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec

EXTRA_OF = {
    "SALib": "campaign",
    "asammdf": "mdf",
    "can_isotp": "diag",
    "distributed": "campaign",
    "fmpy": "fmu",
    "isotp": "diag",
    "matplotlib": "figures",
    "mcap": "mcap",
    "pysindy": "perf",
    "rich": "live",
    "shtab": "completion",
    "udsoncan": "diag",
    "vehiclemodels": "verify",
    "websockets": "live",
}
"""Modules that are no requirement of every command, and the extra that brings each."""


def missing(module: str) -> str:
    """Say that a module of an extra is not installed, and what installs it; empty where it is there."""
    if find_spec(module) is not None:
        return ""
    return f"needs {module}, which is not installed; install it with: {pip_install(EXTRA_OF[module])}"


def pip_install(extra: str) -> str:
    """Return the command that installs an extra's packages into the Python that runs.

    It names the packages themselves, and so works for a clone, a wheel and an index alike.
    """
    try:
        needed = requires("brakebench") or []
    except PackageNotFoundError:
        needed = []
    marked = [text.partition(";") for text in needed]
    names = [name.strip() for name, _, marker in marked if re.search(rf"extra == ['\"]{extra}['\"]", marker)]
    if not names:  # started from a clone that is not installed, or was before it had this extra
        names = ["--editable", f".[{extra}]"]
    return shlex.join([sys.executable, "-m", "pip", "install", *names])

"""What it takes to make a page again."""

import os
import platform
import shlex
import sys
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.report.report import Report

_PACKAGES = ("brakebench", "numpy", "scipy", "numba", "cantools", "pyarrow")


def origin() -> dict[str, object]:
    """Return command line, folder it was given in, versions and machine."""
    return {
        "command line": shlex.join(["brakebench", *sys.argv[1:]]),
        "folder": str(Path.cwd()),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in _PACKAGES},
        "host": {"kernel": platform.release(), "machine": platform.machine(), "processors": os.cpu_count()},
    }


def with_origin(report: "Report") -> "Report":
    """Return the report with `origin` after what it says of itself."""
    return replace(report, provenance={**report.provenance, **origin()})

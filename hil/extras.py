"""The command that installs what an extra of this package needs."""

import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, requires


def pip_install(extra: str) -> str:
    """Return the command that installs an extra's packages into the Python that runs.

    It names the packages themselves, and so works for a clone, a wheel and an index alike.
    """
    try:
        needed = requires("brakebench") or []
    except PackageNotFoundError:  # started from its sources, without an installation
        return shlex.join([sys.executable, "-m", "pip", "install", "--editable", f".[{extra}]"])
    marked = [text.partition(";") for text in needed]
    names = [name.strip() for name, _, marker in marked if re.search(rf"extra == ['\"]{extra}['\"]", marker)]
    return shlex.join([sys.executable, "-m", "pip", "install", *names])

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
    except PackageNotFoundError:
        needed = []
    marked = [text.partition(";") for text in needed]
    names = [name.strip() for name, _, marker in marked if re.search(rf"extra == ['\"]{extra}['\"]", marker)]
    if not names:  # started from a clone that is not installed, or was before it had this extra
        names = ["--editable", f".[{extra}]"]
    return shlex.join([sys.executable, "-m", "pip", "install", *names])

"""cantools without its tester, which nobody here uses.

``import cantools`` imports its tester, and with it python-can and, where they are installed, asammdf and pandas: half a
second of processor time at the start of each of our processes. So the tester waits until somebody asks for it.
"""

# ruff: noqa: E402 (what stands below must be imported after the tester was made to wait)

import importlib
import sys
from types import ModuleType
from typing import Any


class _Waiting(ModuleType):
    """Stands in for a module until something of it is wanted."""

    def __getattr__(self, name: str) -> Any:
        return getattr(importlib.import_module(self.__name__), name)


if "cantools" not in sys.modules:
    sys.modules["cantools.tester"] = _Waiting("cantools.tester")
    importlib.import_module("cantools")
    del sys.modules["cantools.tester"]

import cantools
from cantools.database import Database
from cantools.database.can import Message as DbcMessage
from cantools.database.can import Signal as DbcSignal

__all__ = ["Database", "DbcMessage", "DbcSignal", "cantools"]

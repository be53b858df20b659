"""Takes log files of several formats and gives frames and decoded signals as columns, and the way back.

>>> from hil.log import open_log
>>> with open_log("drive.blf") as log:  # doctest: +SKIP
...     for frames in log.tables():  # piece by piece, in bounded memory
...         print(len(frames), frames.can_id)
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.log.frames import FrameFlag, FrameTable, LogError, Recording
    from hil.log.read import Log, log_format, open_log, read_log
    from hil.log.signals.decode import DecodedLog, Decoder, decode_log

_MODULES = {
    "DecodedLog": "signals.decode", "Decoder": "signals.decode", "decode_log": "signals.decode",
    "FrameFlag": "frames", "FrameTable": "frames", "LogError": "frames", "Recording": "frames",
    "Log": "read", "log_format": "read", "open_log": "read", "read_log": "read",
}  # fmt: skip

__all__ = [
    "DecodedLog", "Decoder", "FrameFlag", "FrameTable", "Log", "LogError", "Recording", "decode_log", "log_format",
    "open_log", "read_log",
]  # fmt: skip


def __getattr__(name: str) -> Any:  # each module is loaded when something of it is used
    if name in _MODULES:
        return getattr(importlib.import_module(f"hil.log.{_MODULES[name]}"), name)
    raise AttributeError(f"module hil.log has no attribute {name}")

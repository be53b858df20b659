"""Takes log files of several formats and gives frames and decoded signals as columns, and the way back."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil.log.read import Log as Log
    from hil.log.read import open_log as open_log

__all__ = ["Log", "open_log"]


def __getattr__(name: str) -> Any:  # so that reading a log costs nothing to whom only wants its columns
    if name in __all__:
        from hil.log import read

        return getattr(read, name)
    raise AttributeError(name)

"""Who is told that a pass is being compiled: it takes seconds, once after installation."""

from collections.abc import Callable

listeners: list[Callable[[], None]] = []
"""Called when a compilation begins, from the thread that needs it; its end is not told."""

"""Progress with the remaining time, where something takes long: the one for all commands."""

import sys
from typing import IO, Self

from hil.log.compiling import listeners
from hil.rt.clock import monotonic_ns

QUIET_S = 2.0  # nothing is shown before
EVERY_S = 0.2
PIPE_QUIET_S, PIPE_EVERY_S = 10.0, 30.0
"""Where it is no terminal: nothing before, and a line as often; logs of a machine stay short."""


def duration_text(seconds: float) -> str:
    """Time to go: ``45 s``, ``3 min 05 s``, ``2 h 10 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class Progress:
    """Shows on standard error which share is done: one line that changes, or elsewhere than on a terminal a line now
    and then.

    Parameters
    ----------
    parts : how often the whole is gone through (`part`).
    """

    def __init__(self, parts: int = 1, stream: IO[str] | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._live = self._stream.isatty()
        self._parts = parts
        self._part = 0
        self._what = "reading"
        self._began_s = monotonic_ns() / 1e9
        self._shown_s = 0.0
        self._width = 0
        self._share = 0.0

    def __enter__(self) -> Self:
        if self._live:
            listeners.append(self._compiling)
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            listeners.remove(self._compiling)
        self._clear()

    def part(self, number: int, what: str) -> Self:
        """Go on to a part, counted from 0; ``what`` is being done in it."""
        self._part, self._what = number, what
        return self

    def __call__(self, done: float) -> None:
        """Tell the share of this part that is done, 0 to 1."""
        now = monotonic_ns() / 1e9
        passed = now - self._began_s
        quiet_s, every_s = (QUIET_S, EVERY_S) if self._live else (PIPE_QUIET_S, PIPE_EVERY_S)
        if passed < quiet_s or now - self._shown_s < every_s:
            return
        self._shown_s = now
        share = self._share = min(1.0, max(self._share, (self._part + done) / self._parts))  # never back
        left = f", {duration_text(passed / share * (1 - share))} left" if share > 0.005 else ""
        self._show(f"{self._what}  {100 * share:3.0f} %{left}")

    def tell(self, line: str) -> None:
        """Say a line of its own."""
        self._clear()
        self._stream.write(f"{line}\n")
        self._stream.flush()

    def _compiling(self) -> None:
        self._show("compiling what reads this log, once after installation: some seconds")

    def _clear(self) -> None:
        if self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._stream.flush()
            self._width = 0

    def _show(self, line: str) -> None:
        if not self._live:
            self._stream.write(f"{line.strip()}\n")
            self._stream.flush()
            return
        self._stream.write("\r" + line.ljust(self._width))
        self._stream.flush()
        self._width = max(self._width, len(line))

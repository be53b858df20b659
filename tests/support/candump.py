"""can-utils' candump as a witness: what it wrote was on the interface."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import NamedTuple

from processes import wait_until


class Line(NamedTuple):
    """A line of candump's own log."""

    time_s: float
    can_id: int
    data: bytes
    error: bool


class Candump:
    """can-utils' candump beside a test, writing its own log file.

    Attributes
    ----------
    path : its log.
    """

    def __init__(self, interface: str, folder: Path) -> None:
        folder.mkdir()
        listeners = self._listeners(interface)
        with (folder / "words.txt").open("w") as words:
            command = ["candump", "-l", "-d", "-r", "4000000", f"{interface},0:0,#FFFFFFFF"]
            self._process = subprocess.Popen(command, cwd=folder, stdout=words, stderr=words)
        wait_until(lambda: self._listeners(interface) > listeners, "candump to listen", 10)
        self.path: Path = wait_until(lambda: next(folder.glob("candump-*.log"), None), "candump's log", 10)

    @staticmethod
    def _listeners(interface: str) -> int:
        """Sockets that take every frame and every error of an interface."""
        errors = Path("/proc/net/can/rcvlist_err").read_text().split()
        return min(Path("/proc/net/can/rcvlist_all").read_text().split().count(interface), errors.count(interface))

    def kill(self) -> None:
        """End it, however the test went."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def stop(self) -> list[Line]:
        """End it as Ctrl-C does and return what it saw; it must not have lost a frame."""
        self._process.send_signal(signal.SIGINT)
        self._process.wait(10)
        words = (self.path.parent / "words.txt").read_text()
        assert "DROPCOUNT" not in words, words
        seen = []
        for line in self.path.read_text().splitlines():
            time, _, frame = line.split()[:3]
            identifier, data = frame.split("#")
            number = int(identifier, 16)
            error = len(identifier) == 8 and bool(number & 0x20000000)
            seen.append(Line(float(time.strip("()")), number & 0x1FFFFFFF, bytes.fromhex(data), error))
        return seen

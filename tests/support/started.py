"""A brakebench command under way, and what its recording says meanwhile."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

from processes import wait_until

from dbc.contract import spec_of

COMMAND = [sys.executable, "-m", "hil.cli.main"]
BRAKING_NM = -100.0


class Started(NamedTuple):
    """A command under way; what it says goes to a file that can be read meanwhile."""

    process: subprocess.Popen[str]
    words: Path

    def says(self, text: str) -> str:
        """Wait for a line that holds ``text``; the line."""

        def line() -> str | None:
            assert self.process.poll() is None, self.words.read_text()
            return next((one for one in self.words.read_text().splitlines() if text in one), None)

        return str(wait_until(line, f"`{text}`"))


def latest(log: Path, message: type[Any], count: int = 1) -> list[Any]:
    """Last messages of a type in one of our recordings, at most ``count``; only its end is read."""
    if not log.exists():
        return []
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - 16384 - 2048 * count))
        text = file.read().decode()
    spec = spec_of(message)
    found = re.findall(rf" {spec.bus} {spec.can_id:03X}#([0-9A-F]{{{2 * spec.length}}})\n", text)
    return [spec.decode(bytes.fromhex(data)) for data in found[-count:]]


def brakes(demand: Any) -> bool:
    """Whether every motor of a motor demand brakes."""
    return all(torque is not None and torque < BRAKING_NM for torque in demand)


def blended(duration_s: float) -> str:
    """A scenario: a car goes downhill, so that the motors brake too, for so long."""
    return f"""title = "the motors brake too, for long: it goes downhill"
[start]
speed_mps = 20.0
[driver]
pedal = [[0.2, 0.0], [0.4, 0.6]]
[[road]]
start_m = -100.0
grade = -0.25
[end]
duration_s = {duration_s}
[ecu.blend]
blending_factor = 0.7
"""

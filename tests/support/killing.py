"""A scenario whose run ends its own process, as an access out of memory would: for a campaign's workers."""

import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

from hil.campaign.engine import work
from hil.campaign.tasks import Base, Done, Task


@dataclass(frozen=True)
class KillingBase(Base):
    """Ends the process where it is given the fatal speed; each time leaves a line in a file."""

    fatal_mps: float = 0.0
    log: str = ""

    def scenario(self, changes):
        if changes.get("start.speed_mps") == self.fatal_mps:
            with Path(self.log).open("a") as file:
                file.write("killed\n")
            os.kill(os.getpid(), signal.SIGKILL)
        return super().scenario(changes)


def fatal(task: Task, speed_mps: float, log: Path) -> Task:
    """A task whose run at this speed ends its worker."""
    bases = {name: KillingBase(**vars(base), fatal_mps=speed_mps, log=str(log)) for name, base in task.bases.items()}
    return replace(task, bases=bases)


def performed(tasks, workers) -> Done:
    """Everything together, in order of the runs."""
    whole = Done()
    for done in work(tasks, workers):
        whole.add(done)
    whole.rows.sort(key=lambda row: row["run"])
    return whole

"""A scenario whose run ends its own process, as an access out of memory would: for a campaign's workers."""

import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

from hil.campaign.engine import Killed, Workers, work
from hil.campaign.plan import Plan
from hil.campaign.tasks import Base, Runner, killed


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


def fatal(runner: Runner, speed_mps: float, log: Path) -> Runner:
    """As a runner, but the run at this speed ends its worker."""
    bases = {name: KillingBase(**vars(base), fatal_mps=speed_mps, log=str(log)) for name, base in runner.bases.items()}
    return replace(runner, bases=bases)


def performed(plan: Plan, runner: Runner, workers: Workers) -> list[dict]:
    """Rows of all runs, in their order."""
    rows = []
    for batch, results in work(map(plan.part, range(plan.parts)), runner, workers):
        for run, result in zip(batch, results, strict=True):
            rows.append((killed(run, result.times) if isinstance(result, Killed) else result).row)
    return sorted(rows, key=lambda row: row["run"])

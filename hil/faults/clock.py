"""The machine's time of day jumps. Only inside the laboratory of its own kernel, never on a host."""

import os

from dbc.messages import BrakeMode
from hil.faults.fault import Expected, FaultError, FaultKind, Parameter, Side
from hil.faults.targets import Takes
from hil.rt.clock import step_wall_clock

LAB_VARIABLE, LAB = "VCAN_LAB", "uml"  # what .ci/vcan-lab sets inside its user-mode Linux


def jump(seconds: float) -> None:
    """Step the machine's time of day.

    Raises
    ------
    FaultError
        This is not the laboratory, whose kernel has a clock of its own.
    """
    if os.environ.get(LAB_VARIABLE) != LAB:
        raise FaultError("clock_step: only inside the vcan laboratory (.ci/vcan-lab), whose kernel has its own clock")
    step_wall_clock(seconds)


FAULTS: tuple[tuple[FaultKind, None], ...] = (
    (FaultKind(110, "clock_step", "clock", "The time of day jumps; the laboratory's tests do it with "
               "`hil.faults.clock.jump`.", "wall clock jumps", Side.HOST, Takes.HOST, ("HOST",),
               Expected(frozenset({BrakeMode.NORMAL})),
               (Parameter("step_s", "s", -1e6, 1e6, 3600.0, "by how much"),), of_target=False, in_virtual_time=False),
     None),
)  # fmt: skip

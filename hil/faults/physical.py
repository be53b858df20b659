"""Physical faults of the car that are switched on and off while it drives, on every bus.

The bench sends them to the plant as commands; what each breaks is `PhysicalFault` in `bench.dbc`.
"""

from dataclasses import dataclass

from dbc.bench_messages import PhysicalFault

WHEELS = ("fl", "fr", "rl", "rr")
ALL_WHEELS = 0b1111
FAULT_NAMES = tuple(fault.name.lower() for fault in PhysicalFault if fault is not PhysicalFault.NONE)


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """A physical fault that is switched on (or off) at a time of the manoeuvre; ``wheels`` has bit 0 for fl."""

    at_s: float
    fault: PhysicalFault
    wheels: int = ALL_WHEELS
    active: bool = True

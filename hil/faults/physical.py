"""Physical faults of the car that are switched on and off while it drives, on every bus.

The bench sends them to the plant as commands; what each breaks is `PhysicalFault` in `bench.dbc`.
"""

from dataclasses import dataclass

from dbc.bench_messages import PAD_FACTOR, FaultCommand, FaultParameter, PhysicalFault
from dbc.contract import Message
from dbc.messages import BrakeMode, Fault
from hil.faults.bus import DETECT_MS, FOUND
from hil.faults.fault import Expected, FaultKind, Injection, Parameter, Side
from hil.faults.parameters import own_parameters
from hil.faults.targets import WHEELS, Takes

__all__ = ["ALL_WHEELS", "FAULTS", "FAULT_NAMES", "WHEELS", "FaultEvent", "events_of"]

ALL_WHEELS = 0b1111
FAULT_NAMES = tuple(fault.name.lower() for fault in PhysicalFault if fault is not PhysicalFault.NONE)


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """A physical fault that is switched on (or off) at a time of the manoeuvre.

    ``wheels`` has bit 0 for fl; ``numbers`` go before the command.
    """

    at_s: float
    fault: PhysicalFault
    wheels: int = ALL_WHEELS
    active: bool = True
    numbers: tuple[FaultParameter, ...] = ()

    @property
    def messages(self) -> tuple[Message, ...]:
        """What switches it on the bench bus: its numbers, then the command."""
        return (*self.numbers, FaultCommand(self.fault, int(self.active), self.wheels))


def events_of(injection: Injection) -> list[FaultEvent]:
    """Switching on and, where it ends, off; an intermittent fault switches as often as it fits into its time."""
    fault, wheels = PhysicalFault[injection.kind.name.upper()], injection.target.wheels
    numbers = tuple(own_parameters(injection))
    on_s, off_s, for_s = (injection.number(name) for name in ("on_s", "off_s", "for_s"))
    begin_s, end_s = max(injection.at_s, 0.0), max(injection.at_s, 0.0) + (for_s or LONGEST_S)
    cycle_s = on_s + off_s
    number = int((end_s - begin_s - 1e-9) / cycle_s) + 1 if cycle_s else 1
    events: list[FaultEvent] = []
    for k in range(number):
        start_s = begin_s + k * cycle_s
        stop_s = min(start_s + on_s, end_s) if cycle_s else end_s
        events.append(FaultEvent(start_s, fault, wheels, numbers=numbers))
        if stop_s < begin_s + LONGEST_S:
            events.append(FaultEvent(stop_s, fault, wheels, active=False))
    return events


LONGEST_S = 3600.0  # as long as a manoeuvre can be
_FACTOR = Parameter("factor", "", 0.0, 2.0, 0.5, "their friction over that of pads that are well")
_ROW = "motor, axle, battery, brake circuit"
_MOTORS = Fault.MOTOR_FRONT | Fault.MOTOR_REAR
_PRESSURES = Fault.EHB_PRESSURE_FRONT | Fault.EHB_PRESSURE_REAR
_SILENT_MS = 150.0  # a motor that does not do what it is asked, and does not say so (budget of the silent motor)


def _kind(
    number: int, name: str, text: str, trouble: Fault, detect_ms: float | None, usual: tuple[str, ...], braking: bool,
    parameters: tuple[Parameter, ...] = (),
) -> FaultKind:  # fmt: skip
    modes = FOUND | {BrakeMode.NORMAL} if detect_ms is None else FOUND
    reaction = Expected(modes, trouble, detect_ms, None if detect_ms is None else detect_ms + 10.0, braking)
    return FaultKind(
        number, name, "physical", text, _ROW, Side.PLANT, Takes.WHEELS, usual, reaction, parameters, of_target=False
    )  # fmt: skip


_EACH = ("fl", "fr", "rl", "rr", "front", "rear", "all")

FAULTS: tuple[tuple[FaultKind, None], ...] = (
    (_kind(70, "motor_dead", "A motor has no torque and says that it has failed.", _MOTORS, DETECT_MS, _EACH, False),
     None),
    (_kind(71, "motor_deaf", "A motor gives no torque, its current says so, its state says that it is well.", _MOTORS,
           _SILENT_MS, ("fl", "rear", "all"), False), None),
    (_kind(72, "motor_weak", "A motor gives half of what it is asked, and says that it is well.", _MOTORS, _SILENT_MS,
           ("fl", "all"), False), None),
    (_kind(73, "motor_stuck_on", "A motor keeps the torque that it had, whatever it is asked.", _MOTORS, None,
           ("fl", "all"), True), None),
    (_kind(74, "ehb_circuit_failed", "The pressure of the wheels goes to 0, the brake says that it has failed.",
           _PRESSURES, DETECT_MS, ("front", "rear"), True), None),
    (_kind(75, "accumulator_empty", "The brake holds the pressure that it has and can only release; its state says "
           "that it follows.", _PRESSURES, None, ("all",), True), None),
    (_kind(76, "battery_refuses_charge", "The battery announces no charge power, and enforces it after its notice.",
           Fault.BATTERY | _MOTORS, None, ("all",), False), None),
    (_kind(PAD_FACTOR[0], "pad_friction", "The pads of a wheel have `factor` times their friction; nothing says so.",
           Fault.NONE, None, ("fl", "fr", "rl", "rr", "front", "all"), True, (_FACTOR,)), None),
)  # fmt: skip

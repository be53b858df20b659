"""What a fault of the library is, and one that is armed: which, on what, when, with which numbers."""

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from dbc.messages import BrakeMode
from dbc.messages import Fault as Trouble
from hil.errors import BrakebenchError
from hil.faults.targets import Takes, Target, target_named

MOST_SEEDS = 1 << 16
FOR_GOOD = math.inf
FROM_THE_FIRST_TICK = -math.inf


class FaultError(BrakebenchError):
    """A fault that is not known or cannot be armed so; the message says what can."""


class Side(StrEnum):
    """Where a fault acts."""

    SENDER = "sender"  # between the node that sends and the bus: everybody sees it, the recording too
    RECEIVER = "receiver"  # between the bus and the node that reads
    PLANT = "plant"  # in the car itself
    PROCESS = "process"  # the process that plays the node
    RECORDER = "recorder"
    HOST = "host"  # the machine


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number of a fault.

    Attributes
    ----------
    unit : empty for a count or share; ``SI`` for the SI unit of the signal it acts on.
    default : None where it follows from the signal's range, as ``text`` says.
    """

    name: str
    unit: str
    low: float
    high: float
    default: float | None
    text: str


COMMON = (
    Parameter("for_s", "s", 0.0, 3600.0, 0.0, "how long it acts; 0: for good"),
    Parameter("count", "", 0.0, 1e6, 0.0, "how many frames it befalls, then it is over; 0: any number"),
    Parameter("on_s", "s", 0.0, 3600.0, 0.0, "intermittent: acts so long, then"),
    Parameter("off_s", "s", 0.0, 3600.0, 0.0, "pauses so long, and again; both 0: without a pause"),
)
"""Parameters that every fault of frames has, indices 0 to 3 of FAULT_PARAMETER; its own follow."""


@dataclass(frozen=True, slots=True)
class Expected:
    """What is right for a controller to do.

    Attributes
    ----------
    modes : modes that it may be in while the fault acts; NORMAL is right until the fault is found.
    trouble : what it may report, these bits and no other; one of them at least where there is a budget.
    detect_ms : time from the first frame befallen (or the switch in the car) to the report; None: need not be found.
    motor_zero_ms : time to no torque demand for what has failed; None: not asked.
    braking : whether an effect on the stop is forced by physics or by the driver's channel itself.
    """

    modes: frozenset[BrakeMode]
    trouble: Trouble = Trouble.NONE
    detect_ms: float | None = None
    motor_zero_ms: float | None = None
    braking: bool = False


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A named fault.

    Attributes
    ----------
    number : on the bench bus, for good.  name, family, text : for people.
    row : of the table of faults that it belongs to.
    side : where it acts.  takes : what it can be armed on.
    usual, usual_values : what a campaign arms it on, in turn, and with which parameters.
    parameters : its own, beside `COMMON`.
    reaction : what is expected, by the target's trouble codes where ``of_target``.
    of_target : whether trouble codes (and the pedal's modes) follow from the target.
    in_virtual_time : whether it exists there; else real processes only.
    lead : name of the parameter by which it begins to listen before it acts.
    refuses : why a target cannot have it; empty where it can.
    """

    number: int
    name: str
    family: str
    text: str
    row: str
    side: Side
    takes: Takes
    usual: tuple[str, ...]
    reaction: Expected
    parameters: tuple[Parameter, ...] = ()
    of_target: bool = True
    in_virtual_time: bool = True
    lead: str = ""
    usual_values: tuple[tuple[str, float], ...] = ()
    refuses: Callable[[Target], str] | None = None

    @property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """Common ones first: their places are the indices of FAULT_PARAMETER."""
        return (*COMMON, *self.parameters)

    def on(
        self,
        target: str | None = None,
        *,
        at_s: float = FROM_THE_FIRST_TICK,
        seed: int | None = None,
        values: Mapping[str, float] | None = None,
    ) -> "Injection":
        """Arm it (not yet on any bench): target by name, manoeuvre time, and parameters by name.

        Raises
        ------
        FaultError
            A target that it does not take, an unknown parameter, or a number out of its bounds.
        """
        what = target_named(self.usual[0] if target is None else target, self.takes, self.name)
        why = "" if self.refuses is None else self.refuses(what)
        if why:
            raise FaultError(f"fault {self.name}: {what} {why}; choose another signal")
        given = dict(values or {})
        known = {p.name: p for p in self.all_parameters}
        for name, value in given.items():
            if name not in known:
                raise FaultError(f"fault {self.name}: no parameter {name!r}{nearest(name, known)}")
            p = known[name]
            if isinstance(value, bool) or not isinstance(value, int | float) or not p.low <= value <= p.high:
                raise FaultError(
                    f"fault {self.name}: {name}: expected a number from {p.low:g} to {p.high:g} {p.unit}".rstrip()
                    + f", got {value!r}"
                )
        if seed is not None and not 0 <= seed < MOST_SEEDS:
            raise FaultError(f"fault {self.name}: seed: expected 0 to {MOST_SEEDS - 1}, got {seed!r}")
        if bool(given.get("on_s")) != bool(given.get("off_s")):
            raise FaultError(f"fault {self.name}: on_s and off_s belong together: give both, above 0")
        return Injection(self, what, at_s, {name: _kept(float(value)) for name, value in given.items()}, seed)


@dataclass(frozen=True, slots=True)
class Injection:
    """An armed fault.

    Attributes
    ----------
    at_s : manoeuvre time of its begin; `FROM_THE_FIRST_TICK` before anything else.
    values : parameters that are not at their defaults.
    seed : of all that is random; None takes one from the run's.
    """

    kind: FaultKind
    target: Target
    at_s: float = FROM_THE_FIRST_TICK
    values: Mapping[str, float] = field(default_factory=dict)
    seed: int | None = None

    @property
    def key(self) -> tuple[int, int, int]:
        """What names it on the bench bus: number, target, signal."""
        return self.kind.number, self.target.code, self.target.signal

    @property
    def until_s(self) -> float:
        """Manoeuvre time of its end."""
        return self.at_s + (self.value("for_s") or FOR_GOOD)

    def value(self, name: str) -> float | None:
        """A parameter; None where it follows from the signal's range."""
        if name in self.values:
            return self.values[name]
        return next(p.default for p in self.kind.all_parameters if p.name == name)

    def number(self, name: str) -> float:
        """A parameter that always has a number."""
        value = self.value(name)
        assert value is not None, f"{self.kind.name}.{name} has no default"
        return value

    @property
    def lead_s(self) -> float:
        """How long before ``at_s`` it has to begin to listen."""
        return self.number(self.kind.lead) if self.kind.lead else 0.0

    @property
    def expected(self) -> Expected:
        """What is right for a controller to do about it."""
        reaction = self.kind.reaction
        if self.target.wheels:
            front, rear = self.target.wheels & 0b0011, self.target.wheels & 0b1100
            blamed = reaction.trouble & ~((_OF_FRONT if not front else _NONE) | (_OF_REAR if not rear else _NONE))
            return replace(reaction, trouble=blamed)
        if not self.kind.of_target or reaction.modes == frozenset({BrakeMode.NORMAL}):
            return reaction
        modes = reaction.modes | ({BrakeMode.SAFE_STOP} if self.target.trouble & _PEDALS == _PEDALS else frozenset())
        if not self.target.trouble:  # nobody acts on what it carries
            return replace(reaction, modes=modes | {BrakeMode.NORMAL}, detect_ms=None)
        return replace(reaction, modes=modes, trouble=reaction.trouble | self.target.trouble)

    def __str__(self) -> str:
        numbers = "".join(f", {name} {value:g}" for name, value in self.values.items())
        when = "" if self.at_s == FROM_THE_FIRST_TICK else f" at {self.at_s:g} s"
        return f"{self.kind.name} on {self.target}{when}{numbers}"


_NONE = Trouble.NONE
_PEDALS = Trouble.PEDAL_1 | Trouble.PEDAL_2
_OF_FRONT = Trouble.MOTOR_FRONT | Trouble.EHB_PRESSURE_FRONT
_OF_REAR = Trouble.MOTOR_REAR | Trouble.EHB_PRESSURE_REAR


def _kept(value: float) -> float:
    """What FAULT_PARAMETER can carry: eight significant digits."""
    return float(f"{value:.7e}")


def nearest(name: str, known: Iterable[str]) -> str:
    """The rest of an error about an unknown name: the nearest one, and all of them where they are few."""
    names = list(known)
    close = difflib.get_close_matches(name, names, 1)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(names)}"

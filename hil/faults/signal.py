"""Faults of one signal: what a sensor tells wrongly, in frames that are valid: altered, then protected again.

Values are raw ones on the wire in the end: a value goes to the nearest step, and to the end of what the bits can hold.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence

from dbc.frame import BusName, Frame
from dbc.raw import RawSignal, protected_again, raw_signals
from hil.faults.act import Act, FrameAct, message_of
from hil.faults.bus import FOUND, NORMAL
from hil.faults.fault import Expected, FaultKind, Injection, Parameter, Side
from hil.faults.targets import Takes, Target


class _Signal(FrameAct):
    """Another raw value of one signal, the same counter, the check value that belongs to it."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        (self.can_id,) = injection.target.can_ids
        self.spec = message_of(self.can_id)
        self.signal = _signal_of(injection.target)
        self.before: int | None = None

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Remember the value."""
        self.before = self.signal.read(frame.data)
        return (frame,)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame with another value."""
        raw = self.raw(self.signal.read(frame.data))
        return (frame._replace(data=protected_again(self.spec, self.signal.write(frame.data, raw))),)

    @abstractmethod
    def raw(self, raw: int) -> int:
        """Raw value to send in the place of another."""

    def value_of(self, raw: int) -> float:
        """A raw value in SI."""
        return raw * self.signal.factor + self.signal.offset

    def size(self, name: str, share: float) -> float:
        """A parameter, or that share of the signal's range where it was not given."""
        given = self.injection.value(name)
        return (self.signal.last - self.signal.first) * abs(self.signal.factor) * share if given is None else given


class Value(_Signal):
    """A constant."""

    def raw(self, raw: int) -> int:
        """The parameter, or the end of the range."""
        value = self.injection.value("value")
        return self.signal.last if value is None else self.signal.raw_of(value)


class Offset(_Signal):
    """A constant more; it may grow to that."""

    _begin = 0

    def raw(self, raw: int) -> int:
        """The true value and the offset so far."""
        full = self.injection.number("frames") or 1.0
        self._begin += 1
        grown = min(self._begin / full, 1.0)
        return self.signal.raw_of(self.value_of(raw) + grown * self.size("offset", OFFSET_SHARE))


class Gain(_Signal):
    """A factor."""

    def raw(self, raw: int) -> int:
        """The true value times the factor."""
        return self.signal.raw_of(self.value_of(raw) * self.injection.number("gain"))


class Stuck(_Signal):
    """Stays as it was."""

    def raw(self, raw: int) -> int:
        """The value before the fault."""
        self.before = raw if self.before is None else self.before
        return self.before


class Step(Stuck):
    """Jumps and stays."""

    def raw(self, raw: int) -> int:
        """The value before the fault and the jump."""
        return self.signal.raw_of(self.value_of(super().raw(raw)) + self.size("step", STEP_SHARE))


class Spike(_Signal):
    """One frame in so many is at another value."""

    _number = 0

    def raw(self, raw: int) -> int:
        """The parameter, or the end of the range, in the first of each ``every`` frames."""
        hit = self._number % int(self.injection.number("every")) == 0
        self._number += 1
        value = self.injection.value("value")
        return (self.signal.last if value is None else self.signal.raw_of(value)) if hit else raw


class Noise(_Signal):
    """Normally distributed noise beside what the sensor has."""

    def raw(self, raw: int) -> int:
        """The true value and a random part."""
        part = float(self.random(self.can_id).standard_normal()) * self.size("sigma", NOISE_SHARE)
        return self.signal.raw_of(self.value_of(raw) + part)


class Random(_Signal):
    """Any value of the range, each as likely."""

    def raw(self, raw: int) -> int:
        """A random raw value."""
        first, last = self.signal.first, self.signal.last
        return int(self.random(self.can_id).integers(first, last + 1))


class NotAvailable(_Signal):
    """Says that it is not available."""

    def raw(self, raw: int) -> int:
        """That value."""
        return raw if self.signal.sna is None else self.signal.sna


class OutOfRange(_Signal):
    """Raw values beyond the range that are no word for anything, each as likely."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        s = self.signal
        self._spans = [(s.lowest, s.first), (s.last + 1, s.highest + 1)]  # half open
        self._number = sum(b - a for a, b in self._spans)

    def raw(self, raw: int) -> int:
        """A random one of them."""
        while True:
            index = int(self.random(self.can_id).integers(self._number))
            for first, end in self._spans:
                if index < end - first:
                    break
                index -= end - first
            if first + index != self.signal.sna:
                return first + index


def _signal_of(target: Target) -> RawSignal:
    (can_id,) = target.can_ids
    return raw_signals(BusName.VEHICLE)[message_of(can_id).name][target.signal]


def without_sna(target: Target) -> str:
    """Why a signal cannot say that it is not available."""
    return "has no value that means not available" if _signal_of(target).sna is None else ""


def without_beyond(target: Target) -> str:
    """Why a signal cannot be out of its range."""
    s = _signal_of(target)
    number = s.first - s.lowest + s.highest - s.last
    return "" if number > (s.sna is not None) else "has no raw value beyond its range"


OFFSET_SHARE, STEP_SHARE, NOISE_SHARE = 0.1, 0.2, 0.02
"""What offset, step and noise are of the signal's range where nothing is given: far beyond what a sensor may do."""

PLAUSIBLE_MS = 100.0  # sensors that tell a wrong value: found within ten cycles (an assumption of the project)
SPIKES_MS = 500.0  # ten spikes of one frame in five
_ROW, _NONE = "implausible sensor", "not available, out of range"
_SENSORS = (
    "WHEEL_SPEED_FRONT.WHEEL_SPEED_FL", "WHEEL_SPEED_REAR.WHEEL_SPEED_RR", "BRAKE_PEDAL.PEDAL_TRAVEL_1",
    "BRAKE_PEDAL.PEDAL_TRAVEL_2", "EHB_PRESSURE_FRONT.PRESSURE_FL", "BODY_MOTION.LONGITUDINAL_ACCELERATION",
    "MOTOR_STATUS_FRONT.CURRENT_FL",
)  # fmt: skip
_ANY = (*_SENSORS, "STEERING.STEERING_WHEEL_ANGLE", "BATTERY_STATUS.CHARGE_POWER_LIMIT",
        "MOTOR_STATUS_REAR.TORQUE_AVAILABLE_RL")  # fmt: skip
_FOUND = Expected(FOUND, detect_ms=PLAUSIBLE_MS)
_MAY_BE_FOUND = Expected(FOUND | NORMAL)


def _optional(name: str, text: str) -> Parameter:
    return Parameter(name, "SI", -1e9, 1e9, None, text)


def _kind(
    number: int, name: str, text: str, reaction: Expected, *parameters: Parameter,
    usual: tuple[str, ...] = _SENSORS, row: str = _ROW, refuses: Callable[[Target], str] | None = None,
) -> FaultKind:  # fmt: skip
    return FaultKind(
        number, name, "signal", text, row, Side.SENDER, Takes.SIGNAL, usual, reaction, parameters,
        usual_values=(("for_s", 0.5),), refuses=refuses,
    )  # fmt: skip


FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (_kind(50, "signal_value", "A signal has a constant value.", _FOUND,
           _optional("value", "the value; left out: the upper end of the range")), Value),
    (_kind(51, "signal_offset", "A signal is off by a constant.", _FOUND,
           _optional("offset", "what is added; left out: a tenth of the range"),
           Parameter("frames", "", 0.0, 1e5, 0.0, "grows to that over so many frames; 0: at once")), Offset),
    (_kind(52, "signal_gain", "A signal is too large or too small by a factor.", _MAY_BE_FOUND,
           Parameter("gain", "", -100.0, 100.0, 1.5, "the factor")), Gain),
    (_kind(53, "signal_stuck", "A signal stays at its last value.", _MAY_BE_FOUND), Stuck),
    (_kind(54, "signal_step", "A signal jumps and stays there.", _FOUND,
           _optional("step", "the jump; left out: a fifth of the range")), Step),
    (_kind(55, "signal_spike", "One frame in `every` has another value.", Expected(FOUND, detect_ms=SPIKES_MS),
           Parameter("every", "", 1.0, 1e5, 5.0, "frames from spike to spike"),
           _optional("value", "the value; left out: the upper end of the range")), Spike),
    (_kind(56, "signal_noise", "Noise beside the signal.", _MAY_BE_FOUND,
           Parameter("sigma", "SI", 0.0, 1e9, None, "standard deviation; left out: a fiftieth of the range")), Noise),
    (_kind(57, "signal_random", "A random value of the range in each frame.", _FOUND), Random),
    (_kind(58, "signal_not_available", "A signal says that it is not available (SNA).", _FOUND, usual=_ANY, row=_NONE,
           refuses=without_sna), NotAvailable),
    (_kind(59, "signal_out_of_range", "Raw values beyond the range.", _FOUND, usual=_ANY, row=_NONE,
           refuses=without_beyond), OutOfRange),
)  # fmt: skip

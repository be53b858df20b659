"""Faults of the end-to-end protection: counter, check value, data id, length, and bits before and after protection.

A fault of the counter leaves the check value right for the wrong counter; a fault of the check value leaves the counter
right, as CANoe's ILNodeDisturbCounter and ILNodeDisturbChecksum do.
"""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from dbc.e2e import COUNTER_MODULUS, check_value, protect
from dbc.frame import Frame
from dbc.raw import protected_again
from hil.faults.act import Act, FrameAct, message_of
from hil.faults.bus import DETECT_MS, FOUND, INPUTS, NORMAL, SHARE
from hil.faults.fault import Expected, FaultKind, Injection, Parameter, Side
from hil.faults.targets import Takes

_FIRST_FREE_BIT = 12  # behind check value and counter


class BitsFlipped(FrameAct):
    """Some bits turned after the protection."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame with so many bits turned."""
        return (frame._replace(data=_flipped(frame.data, self, frame.can_id, 0)),)


class BitsAltered(FrameAct):
    """Some bits turned before the protection: the frame is valid."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Other values, and the check value that belongs to them."""
        data = _flipped(frame.data, self, frame.can_id, _FIRST_FREE_BIT)
        return (frame._replace(data=protected_again(message_of(frame.can_id), data)),)


def _flipped(data: bytes, act: FrameAct, can_id: int, first: int) -> bytes:
    number = min(int(act.injection.number("bits")), 8 * len(data) - first)
    if number <= 0:
        return data
    word = int.from_bytes(data, "little")
    for bit in act.random(can_id).choice(np.arange(first, 8 * len(data)), number, replace=False).tolist():
        word ^= 1 << bit
    return word.to_bytes(len(data), "little")


class _CheckValue(FrameAct):
    """Another check value; the counter is right."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self.before: dict[int, int] = {}

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Remember its check value."""
        self.before[frame.can_id] = frame.data[0]
        return (frame,)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame with another first byte."""
        return (frame._replace(data=bytes([self.value(frame)]) + frame.data[1:]),)

    @abstractmethod
    def value(self, frame: Frame) -> int:
        """Check value to send."""


class CrcValue(_CheckValue):
    """A constant."""

    def value(self, frame: Frame) -> int:
        """The parameter."""
        return int(self.injection.number("value"))


class CrcFrozen(_CheckValue):
    """That of the last frame before; of the first one where none was seen."""

    def value(self, frame: Frame) -> int:
        """The one remembered."""
        return self.before.setdefault(frame.can_id, frame.data[0])


class CrcRandom(_CheckValue):
    """Any of 256, the right one included."""

    def value(self, frame: Frame) -> int:
        """A random one."""
        return int(self.random(frame.can_id).integers(256))


class CrcOffset(_CheckValue):
    """The right one and an offset."""

    def value(self, frame: Frame) -> int:
        """Modulo 256."""
        return (frame.data[0] + int(self.injection.number("offset"))) % 256


class _Counter(FrameAct):
    """Another counter, and the check value that belongs to it."""

    def __init__(self, injection: Injection, armed_ns: int, real: bool = False) -> None:
        super().__init__(injection, armed_ns, real)
        self._goes_on = int(injection.number("goes_on"))
        self.valid: dict[int, int] = {}  # last counter before the fault
        self.sent: dict[int, int] = {}  # last counter sent by it
        self._shift: dict[int, int] = {}

    @property
    def holds(self) -> bool:
        """Whether counters stay shifted."""
        return bool(self._goes_on and self.sent)

    def stop(self, now_ns: int) -> None:
        """Shifted counters end too."""
        super().stop(now_ns)
        self._goes_on = 0

    def keep(self, frame: Frame) -> Sequence[Frame]:
        """Remember the counter; behind the fault go on from where the parameter says."""
        counter = frame.data[1] & 0x0F
        if frame.can_id not in self.sent or not self._goes_on:
            self.valid[frame.can_id] = counter
            return (frame,)
        if frame.can_id not in self._shift:
            last = self.valid[frame.can_id] if self._goes_on == 1 else self.sent[frame.can_id]
            self._shift[frame.can_id] = last + 1 - counter
        return (self._with(frame, (counter + self._shift[frame.can_id]) % COUNTER_MODULUS),)

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The frame with another counter."""
        self._shift.pop(frame.can_id, None)
        self.valid.setdefault(frame.can_id, ((frame.data[1] & 0x0F) - 1) % COUNTER_MODULUS)
        counter = self.sent[frame.can_id] = self.counter(frame)
        return (self._with(frame, counter),)

    @staticmethod
    def _with(frame: Frame, counter: int) -> Frame:
        spec = message_of(frame.can_id)
        if counter < COUNTER_MODULUS:
            return frame._replace(data=protected_again(spec, frame.data, counter))
        data = bytearray(frame.data)  # 15, which no sender gives: with the check value all the same
        data[1] |= 0x0F
        data[0] = check_value(spec.data_id or 0, data)
        return frame._replace(data=bytes(data))

    @abstractmethod
    def counter(self, frame: Frame) -> int:
        """Counter to send."""


class CounterValue(_Counter):
    """A constant."""

    def counter(self, frame: Frame) -> int:
        """The parameter."""
        return int(self.injection.number("value"))


class CounterFrozen(_Counter):
    """The last one before."""

    def counter(self, frame: Frame) -> int:
        """The one remembered."""
        return self.valid[frame.can_id]


class CounterRandom(_Counter):
    """Any of 0 to 14."""

    def counter(self, frame: Frame) -> int:
        """A random one."""
        return int(self.random(frame.can_id).integers(COUNTER_MODULUS))


class CounterOffset(_Counter):
    """The right one and an offset."""

    def counter(self, frame: Frame) -> int:
        """Modulo 15."""
        return ((frame.data[1] & 0x0F) + int(self.injection.number("offset"))) % COUNTER_MODULUS


class CounterJump(_Counter):
    """Steps of more than one from frame to frame."""

    def counter(self, frame: Frame) -> int:
        """The last one sent and the step."""
        before = self.sent.get(frame.can_id, self.valid[frame.can_id])
        return (before + int(self.injection.number("step"))) % COUNTER_MODULUS


class WrongDataId(FrameAct):
    """Protected as if it were another message."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """The check value of another data id."""
        other = ((message_of(frame.can_id).data_id or 0) + int(self.injection.number("offset"))) & 0xFFFF
        return (frame._replace(data=protect(other, bytearray(frame.data), frame.data[1] & 0x0F)),)


class WrongLength(FrameAct):
    """Another number of bytes."""

    def alter(self, frame: Frame) -> Sequence[Frame]:
        """Cut, or filled with 0."""
        length = int(self.injection.number("length"))
        return (frame._replace(data=frame.data[:length].ljust(length, b"\0")),)


_ORDER, _BITS = "frozen counter, replay, jump, swap", "bit flips, wrong data id, wrong length"
_GOES_ON = Parameter(
    "goes_on", "", 0.0, 2.0, 0.0,
    "counter afterwards: 0 as if nothing had been, 1 from the last one before, 2 from the last one sent",
)  # fmt: skip
_BIT_NUMBER = Parameter("bits", "", 1.0, 16.0, 2.0, "how many bits turn")
_FOUND = Expected(FOUND, detect_ms=DETECT_MS + 10.0)  # the fifth bad frame in a row, one cycle behind the time-out
_MAY_BE_FOUND = Expected(FOUND | NORMAL)
_WHERE = (*INPUTS[:2], "EHB_PRESSURE_FRONT", "MOTOR_STATUS_FRONT", "MOTOR_DEMAND_FRONT")


def _kind(
    number: int, name: str, text: str, row: str, reaction: Expected, *parameters: Parameter,
    usual: tuple[str, ...] = _WHERE,
) -> FaultKind:  # fmt: skip
    return FaultKind(
        number,
        name,
        "protection",
        text,
        row,
        Side.SENDER,
        Takes.MESSAGES,
        usual,
        reaction,
        (SHARE, *parameters),
        usual_values=(("for_s", 0.5),),
    )


FAULTS: tuple[tuple[FaultKind, type[Act]], ...] = (
    (_kind(20, "bits_flipped", "Bits turned after the protection, anywhere in the payload.", _BITS, _FOUND,
           _BIT_NUMBER), BitsFlipped),
    (_kind(21, "bits_altered", "Bits of the values turned before the protection: the frame is valid.", _BITS,
           Expected(FOUND | NORMAL, braking=True), _BIT_NUMBER, usual=_WHERE[1:]), BitsAltered),
    (_kind(22, "crc_value", "A constant check value; the counter is right.", _BITS, _FOUND,
           Parameter("value", "", 0.0, 255.0, 0.0, "the check value")), CrcValue),
    (_kind(23, "crc_frozen", "The check value stays that of the last frame; the counter is right.", _BITS, _FOUND),
     CrcFrozen),
    (_kind(24, "crc_random", "A random check value; the counter is right.", _BITS, _FOUND), CrcRandom),
    (_kind(25, "crc_offset", "The check value is off by a number; the counter is right.", _BITS, _FOUND,
           Parameter("offset", "", 1.0, 255.0, 1.0, "what is added, modulo 256")), CrcOffset),
    (_kind(26, "counter_value", "A constant counter with its check value; 15 is what no sender gives.", _ORDER,
           _FOUND, Parameter("value", "", 0.0, 15.0, 0.0, "the counter"), _GOES_ON), CounterValue),
    (_kind(27, "counter_frozen", "The counter stays, with its check value.", _ORDER, _FOUND, _GOES_ON),
     CounterFrozen),
    (_kind(28, "counter_random", "A random counter with its check value.", _ORDER, _MAY_BE_FOUND, _GOES_ON),
     CounterRandom),
    (_kind(29, "counter_offset", "The counter is off by a number, with its check value.", _ORDER, _MAY_BE_FOUND,
           Parameter("offset", "", 1.0, 14.0, 5.0, "what is added, modulo 15"), _GOES_ON), CounterOffset),
    (_kind(30, "counter_jump", "The counter advances by more than one from frame to frame.", _ORDER, _MAY_BE_FOUND,
           Parameter("step", "", 2.0, 14.0, 4.0, "step from frame to frame, modulo 15"), _GOES_ON), CounterJump),
    (_kind(31, "data_id_wrong", "Protected with the data id of another message.", _BITS, _FOUND,
           Parameter("offset", "", 1.0, 65535.0, 1.0, "what is added to the data id")), WrongDataId),
    (_kind(32, "length_wrong", "Another number of bytes, the first ones as they were.", _BITS, _FOUND,
           Parameter("length", "", 0.0, 8.0, 7.0, "bytes")), WrongLength),
)  # fmt: skip

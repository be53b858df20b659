"""What a person or a test can ask of a run: driver, road, blending, faults, frames of anybody."""

import re
from collections.abc import Callable, Iterable

from dbc.bench_messages import PhysicalFault
from dbc.frame import Frame
from hil.bench.stimulus import Channel, StimulusNode
from hil.errors import BrakebenchError
from hil.faults.physical import ALL_WHEELS, FAULT_NAMES, WHEELS, FaultEvent

SPEED_UNITS = {"km/h": 1.0 / 3.6, "m/s": 1.0}


class SessionError(BrakebenchError):
    """The bench was asked for something it cannot do; the message says what to do instead."""


def speed_of(speed: str | float) -> float:
    """Speed in m/s of a number (m/s) or of a text such as ``72 km/h``."""
    if isinstance(speed, str):
        found = re.fullmatch(r"\s*([0-9.]+)\s*(\S+)\s*", speed)
        if found is None or found[2] not in SPEED_UNITS:
            raise SessionError(f"speed {speed!r}: expected a number with {' or '.join(SPEED_UNITS)}, such as '72 km/h'")
        return float(found[1]) * SPEED_UNITS[found[2]]
    return float(speed)


def wheels_of(wheel: str | Iterable[str] | None) -> int:
    """Bits of one wheel, some, or (None) all."""
    if wheel is None:
        return ALL_WHEELS
    names = [wheel] if isinstance(wheel, str) else list(wheel)
    odd = [name for name in names if name not in WHEELS]
    if odd:
        raise SessionError(f"wheel {odd[0]!r}: expected {', '.join(WHEELS)}, a list of them, or None for all")
    return sum(1 << WHEELS.index(name) for name in set(names))


class RunControls:
    """What is asked of a stimulus node; what was asked before there is one waits for it.

    Attributes
    ----------
    fault_s : manoeuvre time of the fault injected last, s.
    """

    def __init__(self) -> None:
        self.fault_s: float | None = None
        self._first_speed_mps = 20.0
        self._stimulus_node: StimulusNode | None = None
        self._early: list[Callable[[StimulusNode], None]] = []

    def drive(self, speed: str | float) -> None:
        """Hold a speed while the pedal is free; before the start also the speed the car starts with."""
        mps = speed_of(speed)
        if self._stimulus_node is None:
            self._first_speed_mps = mps
        self._command(lambda d: d.move(Channel.SPEED, mps))

    def coast(self) -> None:
        """Hold no speed any longer."""
        self._command(lambda d: d.leave(Channel.SPEED))

    def pedal(self, travel: float, within: float = 0.3) -> None:
        """Bring the brake pedal to a travel, 0 to 1, within some seconds."""
        if not 0.0 <= travel <= 1.0:
            raise SessionError(f"pedal: expected a travel from 0 to 1, got {travel!r}")
        self._command(lambda d: _move_from_rest(d, Channel.PEDAL, travel, within))

    def steer(self, angle_rad: float, within: float = 0.3) -> None:
        """Bring the steering wheel to an angle, positive to the left."""
        self._command(lambda d: _move_from_rest(d, Channel.STEERING, angle_rad, within))

    def road(
        self,
        friction: float | None = None,
        *,
        left: float | None = None,
        right: float | None = None,
        grade: float | None = None,
    ) -> None:
        """Change the road under the car: friction scale of both sides or of one, and rise over run."""
        new = {
            Channel.FRICTION_LEFT: friction if left is None else left,
            Channel.FRICTION_RIGHT: friction if right is None else right,
            Channel.GRADE: grade,
        }

        def change(stimulus_node: StimulusNode) -> None:
            for channel, value in new.items():
                if value is not None:
                    stimulus_node.move(channel, value)

        self._command(change)

    def blend(self, factor: float) -> None:
        """Share of the braking that is asked of the motors, 0 to 1."""
        if not 0.0 <= factor <= 1.0:
            raise SessionError(f"blend: expected a factor from 0 to 1, got {factor!r}")
        self._command(lambda d: d.move(Channel.BLENDING, factor))

    def inject(self, fault: str, wheel: str | Iterable[str] | None = None, after: float = 0.0) -> None:
        """Break something of the car ``after`` seconds from now."""
        self.fault_s = self._plan(fault, wheel, after, active=True)

    def clear(self, fault: str, wheel: str | Iterable[str] | None = None, after: float = 0.0) -> None:
        """Mend what `inject` broke."""
        self._plan(fault, wheel, after, active=False)

    def _plan(self, fault: str, wheel: str | Iterable[str] | None, after: float, active: bool) -> float:
        if fault not in FAULT_NAMES:
            raise SessionError(f"fault {fault!r}: expected one of {', '.join(FAULT_NAMES)}")
        kind, wheels = PhysicalFault[fault.upper()], wheels_of(wheel)
        at_s = (0.0 if self._stimulus_node is None else self._stimulus_node.next_s) + after
        self._command(lambda d: d.plan(FaultEvent(at_s, kind, wheels, active)))
        return at_s

    def send(self, *frames: Frame) -> None:
        """Send frames of anybody, as they are, on the bus they name."""
        self._command(lambda d: d.also_send(frames))

    def _command(self, command: Callable[[StimulusNode], None]) -> None:
        if self._stimulus_node is None:
            self._early.append(command)
        else:
            command(self._stimulus_node)

    def _take(self, stimulus_node: StimulusNode) -> None:
        """Give the stimulus node what waited for it; it takes all later commands at once."""
        for command in self._early:
            command(stimulus_node)
        self._stimulus_node = stimulus_node


def _move_from_rest(stimulus_node: StimulusNode, channel: Channel, value: float, within_s: float) -> None:
    """Ramp from 0 where the channel was not stimulated before."""
    if stimulus_node.value(channel) is None:
        stimulus_node.move(channel, 0.0)
    stimulus_node.move(channel, value, within_s)

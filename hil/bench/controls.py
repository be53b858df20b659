"""What a person or a test can ask of a run: driver, road, blending, faults, frames of anybody."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Self

from dbc.frame import Frame
from hil.bench.stimulus import Channel, StimulusNode
from hil.errors import BrakebenchError
from hil.faults.catalogue import fault_named
from hil.faults.fault import Expected, Injection
from hil.faults.targets import Takes

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


def wheels_named(wheel: str | Iterable[str] | None) -> str:
    """Name of the target of one wheel, some, or (None) all."""
    if wheel is None or isinstance(wheel, str):
        return wheel or "all"
    return ",".join(wheel)


class Injected:
    """A fault that was armed; as a context it is ended at the block's end."""

    def __init__(self, controls: "RunControls", injection: Injection) -> None:
        self._controls = controls
        self.injection = injection

    @property
    def expected(self) -> Expected:
        """What is right for a controller to do about it."""
        return self.injection.expected

    def clear(self, after: float = 0.0) -> None:
        """End it ``after`` seconds from now."""
        self._controls.clear(self.injection, after=after)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.clear()


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

    def inject(
        self,
        fault: str | Injection,
        on: str | None = None,
        *,
        wheel: str | Iterable[str] | None = None,
        after: float = 0.0,
        seed: int | None = None,
        **values: float,
    ) -> "Injected":
        """Arm a fault of the library (`hil.faults.catalogue`) ``after`` seconds from now.

        Parameters
        ----------
        fault : name, or an armed fault as it is; then its ``at_s`` counts from now.
        on : what it acts on: ``MESSAGE``, ``MESSAGE.SIGNAL``, a node, ``ALL``; for the car see ``wheel``.
        wheel : wheels of a fault of the car: one, some, or None for all.
        seed : of what is random; by default from the run's.
        values : parameters by name, ``for_s`` and ``count`` among them.

        Returns
        -------
        A handle: its ``clear()`` ends the fault, as the end of a ``with`` block does.

        Raises
        ------
        hil.faults.fault.FaultError, hil.faults.targets.TargetError
            No such fault, target or parameter; the message names the nearest.
        """
        now_s = self._now_s
        if isinstance(fault, Injection):
            armed = replace(fault, at_s=now_s + after + (fault.at_s if math.isfinite(fault.at_s) else 0.0))
        else:
            kind = fault_named(fault)
            if kind.takes is Takes.WHEELS and on is None:
                on = wheels_named(wheel)
            armed = kind.on(on, at_s=now_s + after, seed=seed, values=values)
        self.fault_s = armed.at_s
        self._command(lambda d: d.plan(armed))
        return Injected(self, armed)

    def clear(
        self,
        fault: str | Injection,
        on: str | None = None,
        *,
        wheel: str | Iterable[str] | None = None,
        after: float = 0.0,
    ) -> None:
        """End what `inject` began, ``after`` seconds from now."""
        if not isinstance(fault, Injection):
            kind = fault_named(fault)
            if kind.takes is Takes.WHEELS and on is None:
                on = wheels_named(wheel)
            fault = kind.on(on)
        ended, at_s = fault, self._now_s + after
        self._command(lambda d: d.plan_end(ended, at_s))

    @property
    def _now_s(self) -> float:
        """Manoeuvre time at which a command given now acts."""
        return 0.0 if self._stimulus_node is None else self._stimulus_node.next_s

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

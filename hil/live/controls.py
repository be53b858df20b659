"""What a page may do: stimulate driver, road and blending, and arm and end faults, all of it over the bench bus."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from dbc.bench_messages import FaultCommand, FaultParameter, FaultSelect, StimulusDriver, StimulusEcu, StimulusRoad
from dbc.contract import Message, spec_of
from dbc.e2e import COUNTER_MODULUS
from dbc.frame import BusName, Frame, LinkEvent, Received
from hil.errors import BrakebenchError
from hil.faults.catalogue import FAULTS, fault_named
from hil.faults.fault import Injection, Side
from hil.faults.physical import events_of
from hil.faults.targets import target_names
from hil.faults.wire import start_messages, stop_messages

HEARD_NS = 1_000_000_000  # nodes tell of themselves on the bench bus a hundred times a second
_NAMED = 100  # letters of a name that is asked for


class CommandError(BrakebenchError):
    """A page asked for what cannot be done; the message says what can."""


@dataclass(frozen=True, slots=True)
class Control:
    """A value that a page can set, SI units.

    Attributes
    ----------
    message, field : what carries it on the bench bus.
    text, unit, factor : how the page shows it: ``factor`` shown units are one SI unit.
    """

    name: str
    message: type[Message]
    field: str
    low: float
    high: float
    step: float
    text: str
    unit: str = ""
    factor: float = 1.0


CONTROLS = (
    Control("pedal", StimulusDriver, "pedal_travel", 0.0, 1.0, 0.01, "Brake pedal", "%", 100.0),
    Control("steering", StimulusDriver, "steering_wheel_angle_rad", -4.0, 4.0, 0.05, "Steering wheel", "rad"),
    Control("speed", StimulusDriver, "target_speed_mps", 0.0, 40.0, 0.5, "Speed held while the pedal is free", "km/h",
            3.6),
    Control("blending", StimulusEcu, "blending_factor", 0.0, 1.0, 0.01, "Blending: share of the motors", "%", 100.0),
    Control("friction_left", StimulusRoad, "friction_left", 0.05, 1.2, 0.01, "Road friction, left"),
    Control("friction_right", StimulusRoad, "friction_right", 0.05, 1.2, 0.01, "Road friction, right"),
    Control("grade", StimulusRoad, "grade", -0.3, 0.3, 0.01, "Grade, uphill positive", "%", 100.0),
)  # fmt: skip
_STIMULUS = (StimulusDriver, StimulusEcu, StimulusRoad)
_BY_NAME = {control.name: control for control in CONTROLS}


def described() -> dict[str, Any]:
    """Controls and faults, as the page needs them."""
    faults = [
        {
            "name": kind.name, "family": kind.family, "text": kind.text, "usual": list(kind.usual),
            "targets": list(target_names(kind.takes)),
        }
        for kind in FAULTS
        if kind.side is not Side.HOST
    ]  # fmt: skip
    controls = [
        {
            "name": c.name, "low": c.low, "high": c.high, "step": c.step, "text": c.text, "unit": c.unit,
            "factor": c.factor,
        }
        for c in CONTROLS
    ]  # fmt: skip
    return {"controls": controls, "faults": faults}


class Controls:
    """Turns commands of pages into frames of the bench bus.

    A value that is set goes out with every tick until it is released; then scenario and parameters decide again.
    """

    def __init__(self) -> None:
        self.values: dict[str, float] = {}
        self._armed: dict[str, Injection] = {}
        self._counters: dict[type[Message], int] = {}
        self._once: list[Message] = []
        self._ids: dict[int, type[Message]] = {
            spec_of(kind).can_id: kind for kind in (*_STIMULUS, FaultCommand, FaultParameter, FaultSelect)
        }
        self._heard_ns: int | None = None

    @property
    def armed(self) -> list[str]:
        """Faults that were armed and not ended, for people."""
        return list(self._armed)

    def hear(self, now_ns: int, received: Sequence[Received]) -> None:
        """Take what came: whether somebody is there, and the counters of what others send beside us."""
        for item in received:
            if isinstance(item, LinkEvent) or item.bus is not BusName.BENCH:
                continue
            self._heard_ns = now_ns
            kind = self._ids.get(item.can_id)
            if kind is not None and not item.extended and len(item.data) > 1:
                self._counters[kind] = item.data[1] & 0x0F

    def command(self, now_ns: int, asked: Mapping[str, Any]) -> str:
        """Carry out a command.

        Parameters
        ----------
        now_ns : time of this tick.
        asked : ``{"do": "set", "name": ..., "value": SI number or None}``, ``{"do": "fault", "name": ..., "on": ...}``
            or ``{"do": "clear", "name": ..., "on": ...}``.

        Returns
        -------
        What was done, for people.

        Raises
        ------
        BrakebenchError : nobody is on the bench bus, or there is no such value, fault or target.
        """
        if self._heard_ns is None or now_ns - self._heard_ns > HEARD_NS:
            raise CommandError("nobody is on the bench bus; commands need a bench that runs (brakebench run --live)")
        do, name = asked.get("do"), str(asked.get("name"))[:_NAMED]
        if do == "set":
            return self._set(name, asked.get("value"))
        if do in ("fault", "clear"):
            return self._fault(name, str(asked.get("on"))[:_NAMED], ends=do == "clear")
        raise CommandError(f"command {str(do)[:_NAMED]!r}: expected set, fault or clear")

    def _set(self, name: str, value: Any) -> str:
        control = _BY_NAME.get(name)
        if control is None:
            raise CommandError(f"set {name!r}: expected one of {', '.join(_BY_NAME)}")
        if value is None:
            self.values.pop(name, None)
            return f"{control.text}: released"
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not control.low <= value <= control.high:
            got = repr(value)[:_NAMED]
            raise CommandError(f"set {name}: expected a number from {control.low:g} to {control.high:g}, got {got}")
        number = float(value)
        self.values[name] = number
        return f"{control.text}: {number * control.factor:g} {control.unit}".rstrip()

    def _fault(self, name: str, on: str, ends: bool) -> str:
        kind = fault_named(name)
        if kind.side is Side.HOST:
            raise CommandError(f"fault {name}: only inside the vcan laboratory")
        injection = kind.on(on, at_s=0.0, seed=1)
        key = f"{kind.name} on {injection.target}"
        if kind.side is Side.PLANT:
            self._once += replace(events_of(injection)[0], active=not ends).messages
        else:
            self._once += stop_messages(injection) if ends else start_messages(injection)
        if ends:
            self._armed.pop(key, None)
        else:
            self._armed[key] = injection
        return f"{'ended' if ends else 'armed'}: {key}"

    def frames(self) -> list[Frame]:
        """Frames of this tick: commands once, values that are set with every tick."""
        out, self._once = self._once, []
        for kind in _STIMULUS:
            mine = {c.field: self.values[c.name] for c in CONTROLS if c.message is kind and c.name in self.values}
            if mine:
                fields: tuple[str, ...] = kind._fields
                out.append(kind(*[mine.get(field) for field in fields]))
        return [self._protected(message) for message in out]

    def _protected(self, message: Message) -> Frame:
        """A frame with the counter after the last one that anybody sent."""
        kind, spec = type(message), spec_of(type(message))
        counter = self._counters[kind] = (self._counters.get(kind, -1) + 1) % COUNTER_MODULUS
        return Frame(spec.bus, spec.can_id, spec.encode(message, counter))

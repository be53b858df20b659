"""What the live view shows on a terminal: mode, trouble codes, wheels and messages, from the page's own data."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hil.live.feed import Feed
from hil.log.account import printable

WHEELS = ("FL", "FR", "RL", "RR")
LATE_CYCLES = 4  # after as many stated cycles without a frame a receiver of ours takes a message for lost
LEAST_SPEED_MPS = 1.0  # below, slip is a quotient of noise
_BLOCK = 37  # letters of one message: name, cycle, state
_STATE = 9
_WHEELS_WIDTH = 72  # of the table of wheels, with whole words as heads
_GOOD, _FAIR, _BAD, _DIM = "green", "yellow", "bold red", "dim"
_MODES = {"NORMAL": _GOOD, "INIT": _FAIR, "DEGRADED": _FAIR}
_SHORT = {"WRONG_CRC": "crc", "WRONG_SEQUENCE": "sequence", "NOT_AVAILABLE": "absent"}

Car = Mapping[str, float]


@dataclass(slots=True)
class Screen:
    """The last values of a feed, drawn.

    Attributes
    ----------
    feed : decodes the buses.
    car : ``wheel_radius_m``, ``torque_constant_nm_a``; None for another car's database, which has no wheels to show.
    codes : name of each trouble code.
    bus : name of the vehicle bus.
    """

    feed: Feed
    car: Car | None
    codes: Mapping[int, str]
    bus: str
    _values: dict[str, float | None] = field(default_factory=dict)
    _found: dict[int, tuple[str, int]] = field(default_factory=dict)
    _events: list[str] = field(default_factory=list)

    def drawn(self, now_ns: int, width: int, height: int | None = None) -> RenderableType:
        """Take what came since the last call, and draw it.

        Parameters
        ----------
        now_ns : by the clock that stamps frames.
        width, height : of the screen; without a height all messages are shown.
        """
        if (news := self.feed.news()) is not None:
            for number, rows in json.loads(news)["rows"].items():
                message = self.feed.messages[int(number)]
                for signal, value in zip(message.signals, rows[-1][1:], strict=True):
                    self._values[f"{message.name}.{signal.name}"] = value
        state = json.loads(self.feed.state(now_ns, {}))
        self._events = [*self._events, *state["events"]][-2:]
        parts: list[RenderableType] = [self._head(state, width)]
        lines = 1
        if self.car is not None:
            codes = self._trouble()
            parts += [self._wheels(self.car, width), *codes]
            lines += 5 + len(codes)
        parts += [Text(printable(event), _FAIR, no_wrap=True, overflow="crop") for event in self._events]
        lines += len(self._events)
        if state["rows"]:
            parts.append(self._messages(state, width, None if height is None else max(2, height - lines)))
        else:
            parts.append(Text("nothing has come on the buses yet", _FAIR))
        return Group(*parts)

    def _value(self, name: str) -> float | None:
        return self._values.get(name)

    def _word(self, name: str) -> str:
        """Name of a value, as the database has it."""
        value = self._value(name)
        if value is None:
            return "-"
        message, _, signal = name.partition(".")
        choices = next((s.choices for m in self.feed.messages if m.name == message for s in m.signals
                        if s.name == signal), {})  # fmt: skip
        return choices.get(int(value), f"{value:g}")

    def _head(self, state: Mapping[str, Any], width: int) -> Text:
        head = Text(no_wrap=True, overflow="crop")
        if self.car is not None:
            mode = self._word("BRAKE_STATUS.MODE")
            head.append(f" {mode} ", f"reverse {_MODES.get(mode, _FAIR if mode == '-' else _BAD)}")
            speed = self._value("TRUTH_MOTION.SPEED")
            head.append(f"  {_number(None if speed is None else 3.6 * speed, 1)} km/h")
            head.append(f"  manoeuvre {self._word('TRUTH_MOTION.MANOEUVRE').lower()}")
        load = state["load"]
        head.append(f"  load {_number(None if load is None else 100 * load, 1)} %")
        if len(head) + len(self.bus) + 2 <= width:
            head.append(f"  {printable(self.bus)}", _DIM)
        return head

    def _wheels(self, car: Car, width: int) -> Table:
        table = _table(min(width, _WHEELS_WIDTH))
        long = width >= _WHEELS_WIDTH
        for name in ("wheel", "slip %", "pad friction" if long else "friction", "disc C", "pressure bar" if long
                     else "bar", "motor N m"):  # fmt: skip
            table.add_column(name, justify="left" if name == "wheel" else "right", no_wrap=True)
        v = self._value("TRUTH_MOTION.SPEED")
        for wheel in WHEELS:
            axle = "FRONT" if wheel[0] == "F" else "REAR"
            omega = self._value(f"WHEEL_SPEED_{axle}.WHEEL_SPEED_{wheel}")
            current = self._value(f"MOTOR_STATUS_{axle}.CURRENT_{wheel}")
            disc = self._value(f"TRUTH_DISC_TEMPERATURE.DISC_TEMPERATURE_{wheel}")
            slip = None
            if v is not None and omega is not None and abs(v) >= LEAST_SPEED_MPS:
                slip = 100 * (v - omega * car["wheel_radius_m"]) / v
            table.add_row(
                wheel.lower(),
                _number(slip, 1),
                _number(self._value(f"BRAKE_ESTIMATE_{axle}.PAD_FRICTION_{wheel}"), 3),
                _number(None if disc is None else disc - 273.15, 0),
                _number(self._value(f"EHB_PRESSURE_{axle}.PRESSURE_{wheel}"), 1),
                _number(None if current is None else current * car["torque_constant_nm_a"], 0),
            )
        return table

    def _trouble(self) -> list[Text]:
        """Trouble codes, active ones first; the controller sends one at a time."""
        code = self._value("BRAKE_TROUBLE_CODE.TROUBLE_CODE")
        stored = self._value("BRAKE_TROUBLE_CODE.STORED_CODES")
        if (stored or 0) < len(self._found):
            self._found.clear()
        if code:
            times = self._value("BRAKE_TROUBLE_CODE.OCCURRENCES") or 0
            self._found[int(code)] = self._word("BRAKE_TROUBLE_CODE.STATUS").lower(), int(times)
        if not self._found:
            return [Text("trouble codes: " + ("-" if stored is None else "none"), _DIM if stored is None else "")]
        ordered = sorted(self._found.items(), key=lambda one: (one[1][0] != "active", one[0]))
        lines = []
        for number, (status, times) in ordered[:4]:
            line = Text(no_wrap=True, overflow="crop")
            line.append(f"{number:04X} {self.codes.get(number, '')}", _BAD if status == "active" else _FAIR)
            line.append(f"  {status}" + (f", {times} times" if times > 1 else ""))
            lines.append(line)
        if len(ordered) > len(lines):
            lines[-1].append(f"  and {len(ordered) - len(lines)} more codes")
        return lines

    def _messages(self, state: Mapping[str, Any], width: int, height: int | None) -> Table:
        """Messages side by side, those that are late or unsound first; what has no room is counted."""
        rows = sorted((self._message(row) for row in state["rows"]), key=lambda one: one[0])
        beside = max(1, width // _BLOCK)
        room = None if height is None else (height - 1) * beside
        more = state["further"] > 0
        if room is not None and len(rows) > room:
            more = True
        if more and room is not None:
            room -= beside  # the line that counts
        shown = rows if room is None else rows[: max(0, room)]
        table = _table(width)
        for k in range(beside):
            if k:
                table.add_column(width=1)
            table.add_column("message", no_wrap=True, overflow="crop", ratio=1)
            table.add_column("ms", justify="right", no_wrap=True, width=6)
            table.add_column("check", no_wrap=True, width=_STATE)
        lines = -(-len(shown) // beside)
        for n in range(lines):
            cells: list[Text] = []
            for k in range(beside):
                place = n + k * lines
                cells += [Text()] if k else []
                cells += shown[place][1] if place < len(shown) else [Text(), Text(), Text()]
            table.add_row(*cells)
        if more:
            left = len(rows) - len(shown)
            text = [f"{left} more" if left else "", f"{state['further']} frames of others" if state["further"] else ""]
            table.add_row(Text(", ".join(filter(None, text)), _DIM))
        return table

    def _message(self, row: Sequence[Any]) -> tuple[int, list[Text]]:
        """Rank and cells of one message: name, mean cycle, what the end-to-end check says or that it is late."""
        number, _, cycle, age_s, _, status, sound, lost, _ = row
        message = self.feed.messages[number]
        stated = message.message.cycle_time_ms if message.message else None
        late = stated is not None and age_s > LATE_CYCLES * 1e-3 * stated
        word = "" if status is None else _SHORT.get(status, status.lower().replace("_", " "))
        if late and sound:
            word = f"{age_s:.1f} s ago"[:_STATE] if age_s < 100 else "silent"
        elif lost and sound:
            word = f"{word} -{lost}"
        style = _BAD if not sound else _FAIR if late else ""
        cells = [printable(message.name), _number(cycle, 1), word]
        return (0 if not sound else 1 if late else 2), [Text(cell, style) for cell in cells]


def _table(width: int) -> Table:
    return Table(box=None, width=width, padding=(0, 1, 0, 0), pad_edge=False, header_style=_DIM)


def _number(value: float | None, digits: int) -> str:
    """A number; a dash where there is none, and no minus zero."""
    if value is None:
        return "-"
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if not text.strip("-0.") else text

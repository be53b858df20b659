"""What comes on the buses, as messages for the page."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from dbc.frame import BusName, Frame, LinkEvent, Received
from dbc.frame_length import most_classical_bits
from hil.live.message import LiveMessage, Value
from hil.log.signals.databases import Databases

MOST_MESSAGES = 1000
"""Messages and unknown identifiers that are told apart; a bus full of noise fills neither memory nor page."""
MOST_ROWS = 4
"""Frames of one message between two updates of the page: 100 Hz and some more; of others the newest."""
_MOST_EVENTS = 50  # link events between two updates
_DIGITS = 7

Key = tuple[BusName, int, bool]


class Feed:
    """Decodes what both buses carry.

    Parameters
    ----------
    vehicle, bench : databases of the two buses.

    Attributes
    ----------
    messages : all of them, in the order of their numbers.
    further : frames with identifiers beyond `MOST_MESSAGES`.
    """

    def __init__(self, vehicle: Databases, bench: Databases) -> None:
        self._databases = {BusName.VEHICLE: vehicle, BusName.BENCH: bench}
        self._messages: dict[Key, LiveMessage] = {}
        self._order: dict[Key, int] = {}
        self._rows: dict[int, list[list[Value]]] = {}
        self._events: list[str] = []
        self._bits = 0
        self._load_ns: int | None = None
        self._start_ns: int | None = None
        self.further = 0
        self._bench_ns = 0
        self.messages: list[LiveMessage] = []
        for bus, databases in self._databases.items():
            for message in databases.of(bus.value).messages.values():
                if not message.pgn_match and len(self._order) < MOST_MESSAGES:
                    self._add((bus, message.can_id, message.extended))

    def _add(self, key: Key) -> LiveMessage:
        bus, can_id, extended = key
        message = self._databases[bus].message(bus.value, can_id, extended)
        name = f"0x{can_id:X}" if message is None else message.name
        if message is not None and message.pgn_match:
            name += f"@{can_id & 0xFF:02X}"
        live = self._messages[key] = LiveMessage(bus.value, name, can_id, extended, message)
        self._order[key] = len(self._order)
        self.messages.append(live)
        return live

    def hear(self, received: Sequence[Received]) -> None:
        """Take what came, in order."""
        for item in received:
            if isinstance(item, LinkEvent):
                if len(self._events) < _MOST_EVENTS:
                    self._events.append(f"{item.bus}: {item.state} {item.detail}".strip())
            else:
                self._frame(item)

    def _frame(self, frame: Frame) -> None:
        bus, can_id, data, at_ns, extended = frame
        if self._start_ns is None:
            self._start_ns = at_ns
        if bus is BusName.BENCH:
            self._bench_ns = at_ns
        else:
            self._bits += most_classical_bits(extended, len(data)).nominal
        key = (bus, can_id, extended)
        live = self._messages.get(key)
        if live is None:
            if len(self._order) >= MOST_MESSAGES:
                self.further += 1
                return
            live = self._add(key)
        values = live.hear(data, at_ns)
        if values is None:
            return
        row: list[Value] = [round((at_ns - self._start_ns) * 1e-9, 4)]
        row += [None if v is None else v if isinstance(v, int) else _short(v) for v in values]
        rows = self._rows.setdefault(self._order[key], [])
        if len(rows) >= MOST_ROWS:
            del rows[0]
        rows.append(row)

    def described(self) -> list[dict[str, Any]]:
        """All messages, as the page needs them to show signals."""
        return [
            {
                "name": one.name, "bus": one.bus, "id": f"{one.can_id:X}{'x' * one.extended}",
                "sender": one.message.sender if one.message else "",
                "cycle": one.message.cycle_time_ms if one.message else None,
                "signals": [{"name": s.name, "unit": s.unit, "choices": s.choices} for s in one.signals],
            }
            for one in list(self.messages)
        ]  # fmt: skip

    def news(self) -> str | None:
        """Values since the last call; None where there are none."""
        if not self._rows:
            return None
        rows, self._rows = self._rows, {}
        return json.dumps({"kind": "data", "rows": rows}, separators=(",", ":"))

    def state(self, now_ns: int, more: Mapping[str, Any]) -> str:
        """How each message comes, the load of the vehicle bus, and link events since the last call.

        Parameters
        ----------
        now_ns : by the clock that stamps frames.
        more : what else the page is told.
        """
        elapsed_ns = 0 if self._load_ns is None else now_ns - self._load_ns
        self._load_ns = now_ns
        rate = self._databases[BusName.VEHICLE].bit_rate(BusName.VEHICLE.value)
        load = None if not rate or not elapsed_ns else self._bits / (elapsed_ns * 1e-9 * rate)
        self._bits = 0
        events, self._events = self._events, []
        rows = [
            [number, m.count, _rounded(m.cycle_ms), round(max(0, now_ns - m.last_ns) * 1e-9, 2), m.data.hex(),
             m.status, m.sound, *((m.checker.lost, m.checker.corrupt) if m.checker else (None, None))]
            for number, m in enumerate(self.messages)
            if m.count
        ]  # fmt: skip
        return json.dumps(
            {
                "kind": "state", "rows": rows, "load": _rounded(load, 4), "events": events,
                "further": self.further,
                **more, "bench": self._bench_ns > 0 and now_ns - self._bench_ns < 1_000_000_000,
            },
            separators=(",", ":"),
        )  # fmt: skip


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _rounded(value: float | None, digits: int = 2) -> float | None:
    return None if value is None else round(value, digits)

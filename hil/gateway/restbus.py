"""Rest-bus: the messages of nodes that are not there, with start values, edited live. A node without I/O."""

import re
from collections.abc import Collection, Sequence
from pathlib import Path

from dbc.frame import Frame, Received
from hil.gateway.database import UserDatabase
from hil.gateway.error import GatewayError
from hil.gateway.sent import Sending, SentMessage
from hil.gateway.settings import only, raw_value, read_toml, sending_of, signal_of
from hil.gateway.signals import physical

_PROTECTIVE = re.compile(r"CRC|CHECK_?SUM|CHKSUM|COUNTER|ALIVE", re.IGNORECASE)


def sendings(database: UserDatabase, nodes: Collection[str], settings: Path | None = None) -> list[Sending]:
    """How all messages of some nodes are sent.

    Parameters
    ----------
    settings : TOML with ``[send.MESSAGE]`` tables: ``cycle_ms``, ``counter``, ``protection``, ``start`` values.

    Raises
    ------
    GatewayError : unknown node, message, signal or key.
    """
    for node in nodes:
        if node not in database.nodes:
            known = ", ".join(sorted(database.nodes)) or "no node"
            raise GatewayError(f"{database.path}: no messages of a node {node}; {known} sends some")
    tables = {} if settings is None else read_toml(settings, ("send",)).get("send", {})
    chosen = {name for name, message in database.messages.items() if message.sender in nodes}
    for name in only(tables, tuple(database.messages), f"{settings}: send"):
        if name not in chosen:
            sender = database.messages[name].sender or "nobody"
            raise GatewayError(f"{settings}: send.{name}: it is sent by {sender}, not by {', '.join(nodes)}")
    found = []
    source = database.path if settings is None else settings
    for name in sorted(chosen, key=lambda one: database.messages[one].can_id):
        where = f"{source}: send.{name}"
        table = only(tables.get(name, {}), ("cycle_ms", "counter", "protection", "start"), where)
        message = database.messages[name]
        stated = only(table.get("start", {}), tuple(s.name for s in message.signals), f"{where}.start")
        start = {key: raw_value(signal_of(message, key, where), value, where) for key, value in stated.items()}
        found.append(sending_of(database, name, table, start, where))
    return found


def unprotected(sending: Sequence[Sending]) -> list[str]:
    """Signals whose names sound like counter or check value and that nothing computes, as MESSAGE.SIGNAL."""
    return [
        f"{one.message.name}.{signal.name}"
        for one in sending
        if one.protection is None
        for signal in one.message.signals
        if _PROTECTIVE.search(signal.name) and (one.counter is None or one.counter[0] != signal.name)
    ]


class RestBus:
    """Sends messages at their cycle times.

    Parameters
    ----------
    sending : the messages.

    Attributes
    ----------
    names : messages by identifier and whether it is extended.
    """

    def __init__(self, sending: Sequence[Sending]) -> None:
        self._sent = {one.message.name: SentMessage(one) for one in sending}
        self.names = {(one.message.can_id, one.message.extended): one.message.name for one in sending}
        self._off: set[str] = set()
        self._changed: set[str] = set()

    @property
    def sent(self) -> int:
        """Frames sent so far."""
        return sum(one.count for one in self._sent.values())

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Frame]:
        """Send what is due, and what was edited and has no cycle; nothing of the inbox is used."""
        frames = []
        for name, one in self._sent.items():
            if (one.due(now_ns) or name in self._changed) and name not in self._off:
                frames.append(one.frame())
        self._changed.clear()
        return frames

    def edit(self, line: str) -> str:
        """Take ``MESSAGE.SIGNAL=VALUE``, ``MESSAGE=off`` or ``MESSAGE=on``; what it did, for people.

        A value is physical or a name of the value table. A message without a cycle is sent once for each edit.

        Raises
        ------
        GatewayError : it says what is wrong; nothing has changed.
        """
        left, equals, right = (part.strip() for part in line.partition("="))
        name, dot, signal_name = left.partition(".")
        if not equals or not right or not name:
            raise GatewayError(f"{line!r}: expected MESSAGE.SIGNAL=VALUE, MESSAGE=off or MESSAGE=on")
        one = self._sent.get(name)
        if one is None:
            raise GatewayError(f"{line!r}: {name} is not sent here; sent are {', '.join(self._sent)}")
        if not dot:
            if right not in ("on", "off"):
                raise GatewayError(f"{line!r}: a whole message is switched on or off, got {right}")
            (self._off.add if right == "off" else self._off.discard)(name)
            return f"{name} {right}"
        signal = signal_of(one.sending.message, signal_name, repr(line))
        try:
            value: float | str = float(right)
        except ValueError:
            value = right
        raw = raw_value(signal, value, repr(line))
        one.values[signal_name] = raw
        if not one.sending.cycle_ns:
            self._changed.add(name)
        return f"{name}.{signal_name} = {physical(signal, raw):g} {signal.unit}".rstrip()

"""Which message an identifier stands for, channel by channel, as tables that arrays are looked up in."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import PurePath

import numpy as np
import numpy.typing as npt

from dbc.database import Database, Message
from dbc.frame import BusName
from hil.log.signals.signal_plan import MessagePlan, padded_length, plan_message
from hil.log.signals.wanted import Wanted

Databases = Database | Sequence[Database] | Mapping[str, Database | Sequence[Database]]
"""One for all channels, several in the order in which they are asked, or either by channel name."""

NO_DATABASE = -1
IDENTIFIER, WITHOUT_PRIORITY, GROUP = 0, 1, 2
"""Kinds of keys: the whole 29-bit identifier, that without its priority, the J1939 parameter group number."""
TP_CM, TP_DT = 0xEC00, 0xEB00
MAX_NOTES = 20


def group_number(can_id: int) -> int:
    """J1939 parameter group number of an identifier: below PDU format 240 the low byte is a destination."""
    group = can_id >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= 240 else group & 0x3FF00


def key(network: int, kind: int, value: int) -> int:
    """Key of the tables; ``value`` has at most 29 bits."""
    return network << 34 | kind << 32 | value


class Lookup:
    """Messages of all databases, numbered ("slots"), and how frames of each channel find theirs.

    A network is a list of databases; channels that have the same one share it. Whole identifiers go before J1939
    groups within a database, and an earlier database before a later one.

    Attributes
    ----------
    messages : by slot.
    lengths, longest : int64 by slot: bytes by the database, and most bytes that this makes on the wire.
    dense : int32 (networks, 2048), slot by standard identifier, -1 for none.
    keys, slots : int64 and int32, ascending: slot by `key`.
    j1939 : bool by network: it has J1939 messages, so its transport frames are joined.
    notes : identifiers that two databases of a network know.
    """

    def __init__(self, databases: Databases, wanted: Collection[str] | None = None) -> None:
        self.wanted = Wanted(wanted)
        self.messages: list[Message] = []
        self.notes: list[str] = []
        self._names: list[str] = []
        self._taken: set[str] = set()
        self._plans: dict[int, MessagePlan] = {}
        self._slots: dict[tuple[int, tuple[int, bool]], int] = {}
        self._networks: dict[tuple[int, ...], int] = {}
        self._by_channel: dict[str, int] = {}
        self._other = NO_DATABASE
        self.by_key: dict[int, int] = {}
        self._dense: list[npt.NDArray[np.int32]] = []
        self._j1939: list[bool] = []
        if isinstance(databases, Mapping):
            for channel, some in databases.items():
                self._by_channel[channel] = self._network(_several(some), channel)
            self._other = self._by_channel.get("", self._by_channel.get(BusName.VEHICLE.value, NO_DATABASE))
        else:
            self._other = self._network(_several(databases), None)
        self.lengths = np.array([m.length for m in self.messages], np.int64)
        self.longest = np.array([padded_length(m.length) for m in self.messages], np.int64)
        self.dense = np.array(self._dense, np.int32).reshape(-1, 2048)
        self.keys = np.array(sorted(self.by_key), np.int64)
        self.slots = np.array([self.by_key[k] for k in self.keys.tolist()], np.int32)
        self.j1939 = np.array(self._j1939, np.bool_)
        if len(self.notes) > MAX_NOTES:
            further = len(self.notes) - MAX_NOTES
            self.notes[MAX_NOTES:] = [f"and {further} more identifiers that two databases know"]

    def network(self, channel: str) -> int:
        """Network of a channel; a channel that is not named has that of "" or of "vehicle", else none."""
        return self._by_channel.get(channel, self._other)

    def plan(self, slot: int) -> MessagePlan:
        """Return where the signals of a message lie."""
        if slot not in self._plans:
            self._plans[slot] = plan_message(self.messages[slot], self._names[slot], self.wanted)
        return self._plans[slot]

    def group_slot(self, network: int, can_id: int) -> int | None:
        """Slot of the J1939 message that an identifier stands for, whatever its priority."""
        slot = self.by_key.get(key(network, WITHOUT_PRIORITY, can_id & 0x3FF_FFFF))
        return self.by_key.get(key(network, GROUP, group_number(can_id))) if slot is None else slot

    def unmatched(self) -> tuple[str, ...]:
        """Return the wanted names that no message or signal of the databases has."""
        known = zip(self._names, self.messages, strict=True)
        return self.wanted.unmatched((name, [s.name for s in message.signals]) for name, message in known)

    def _network(self, databases: Sequence[Database], channel: str | None) -> int:
        known = tuple(dict.fromkeys(id(d) for d in databases))
        if known in self._networks:
            return self._networks[known]
        number = self._networks[known] = len(self._networks)
        dense = np.full(2048, -1, np.int32)
        before: dict[tuple[int, bool], tuple[Message, str]] = {}
        groups: dict[tuple[int, int], int] = {}  # (kind, value) of J1939 messages so far
        for database in {id(d): d for d in databases}.values():
            own = list(self._of(database, channel))
            for (can_id, extended), message, _ in own:
                first, source = before.setdefault((can_id, extended), (message, database.source))
                if first != message:
                    self.notes.append(
                        f"identifier {can_id:#x}: {first.name} of {source} is used, "
                        f"{message.name} of {database.source} is not"
                    )
            here: dict[tuple[int, int], int] = {}
            for (can_id, _), message, slot in own:
                if message.pgn_match:
                    here.setdefault((WITHOUT_PRIORITY, can_id & 0x3FF_FFFF), slot)
                    group = GROUP, group_number(can_id)
                    if can_id & 0xFF == 0xFE or group not in here:  # Vector's "any source" address goes first
                        here[group] = slot
            for (can_id, extended), message, slot in own:
                if not extended and can_id < 2048:
                    dense[can_id] = slot if dense[can_id] < 0 else dense[can_id]
                elif extended and not message.pgn_match:
                    earlier = groups.get((WITHOUT_PRIORITY, can_id & 0x3FF_FFFF))
                    earlier = groups.get((GROUP, group_number(can_id))) if earlier is None else earlier
                    self.by_key.setdefault(key(number, IDENTIFIER, can_id), slot if earlier is None else earlier)
            groups |= {
                (kind, value): slot
                for (kind, value), slot in here.items()
                if (kind, value) not in groups
                and not (kind == WITHOUT_PRIORITY and (GROUP, group_number(value)) in groups)
            }
        for (kind, value), slot in groups.items():
            self.by_key[key(number, kind, value)] = slot
        self._dense.append(dense)
        self._j1939.append(bool(groups))
        return number

    def _of(self, database: Database, channel: str | None) -> Iterator[tuple[tuple[int, bool], Message, int]]:
        """Messages of a database with their slots."""
        for identifier, message in database.messages.items():
            place = id(database), identifier
            if place not in self._slots:
                self._slots[place] = len(self.messages)
                self.messages.append(message)
                self._names.append(self._free(message.name, channel or PurePath(database.source).stem))
            yield identifier, message, self._slots[place]

    def _free(self, name: str, suffix: str) -> str:
        """Name of a message; one that another database uses already gets a suffix."""
        if name in self._taken:
            name = f"{name}@{suffix}"
        number = 2
        free = name
        while free in self._taken:
            free = f"{name}_{number}"
            number += 1
        self._taken.add(free)
        return free


def _several(databases: Database | Sequence[Database]) -> Sequence[Database]:
    return [databases] if isinstance(databases, Database) else databases

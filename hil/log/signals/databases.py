"""Which database describes which channel of a log."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

from dbc.database import Database, Message
from dbc.frame import BusName
from hil.log.signals.decode import Decoder, own_databases
from hil.log.signals.lookup import TP_CM, TP_DT, group_number

NONE = Database("no database", {}, ())
OWN_CHANNELS = frozenset(bus.value for bus in BusName)  # our recordings name their channels so


@dataclass(frozen=True, slots=True)
class Databases:
    """Databases of a log.

    Attributes
    ----------
    general : of every channel that is not named in ``by_channel``; None where those have none.
    by_channel : by channel name.
    warnings : what was odd about them, and between them.
    guessed : nobody named them; they are tried on a log that may be of another car.
    """

    general: Database | None
    by_channel: Mapping[str, Database] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    guessed: bool = False
    _groups: dict[int, dict[int, Message]] = field(default_factory=dict)

    @classmethod
    def own(cls) -> "Databases":
        """Our own two: bench.dbc for a channel named bench, brake.dbc for all others."""
        ours = own_databases()
        return cls(ours[BusName.VEHICLE.value], {BusName.BENCH.value: ours[BusName.BENCH.value]}, guessed=True)

    @classmethod
    def joined(cls, general: Iterable[Database], by_channel: Mapping[str, Iterable[Database]]) -> "Databases":
        """Join several databases of a channel to one; a message name that two of them use is made unique."""
        warnings: list[str] = []
        taken: set[str] = set()
        known: dict[tuple[int, ...], Database] = {}

        def joined(of: Iterable[Database], channel: str) -> Database:
            some = list({id(one): one for one in of}.values())
            key = tuple(id(one) for one in some)
            if key not in known:
                known[key] = _joined(some, channel, taken, warnings)
            return known[key]

        of_all = list(general)
        one = joined(of_all, "") if of_all else None
        return cls(one, {name: joined(of, name) for name, of in by_channel.items()}, tuple(warnings))

    def of(self, channel: str) -> Database:
        """Database of a channel, one without messages where it has none."""
        return self.by_channel.get(channel, self.general or NONE)

    def bit_rate(self, channel: str) -> int | None:
        """Bit rate of a channel, bit/s; None where no database states it, or only a guessed one does."""
        return None if self.guessed and channel not in OWN_CHANNELS else self.of(channel).bit_rate

    def all(self) -> list[Database]:
        """Every one of them."""
        return [*([self.general] if self.general else []), *self.by_channel.values()]

    def messages(self) -> Iterable[Message]:
        """Every message of every database."""
        for database in self.all():
            yield from database.messages.values()

    @property
    def states_cycles(self) -> bool:
        """Whether they state any cycle time; if so, a message without one is sent on a change, else nothing is told."""
        return any(message.cycle_time_ms for message in self.messages())

    def decoder(self, wanted: Collection[str] | None = None) -> Decoder:
        """Return a decoder of these; ``wanted`` as of `hil.log.signals.decode.Decoder`."""
        return Decoder({"": self.general or NONE, **self.by_channel}, wanted)

    def message(self, channel: str, can_id: int, extended: bool) -> Message | None:
        """Message that an identifier stands for, None where no database describes it."""
        database = self.of(channel)
        message = database.messages.get((can_id, extended))
        if message is None and extended:
            message = self._by_group(database).get(group_number(can_id))
        return message

    def joins(self, channel: str, can_id: int, extended: bool) -> bool:
        """Tell whether these are J1939 transport frames, which the decoder puts together."""
        transport = extended and group_number(can_id) in (TP_CM, TP_DT)
        return transport and bool(self._by_group(self.of(channel)))

    def _by_group(self, database: Database) -> dict[int, Message]:
        """J1939 messages of a database by parameter group number, whatever address they come from."""
        if id(database) not in self._groups:
            matched = [message for message in database.messages.values() if message.pgn_match]
            self._groups[id(database)] = {group_number(message.can_id): message for message in matched}
        return self._groups[id(database)]


def _joined(databases: list[Database], channel: str, taken: set[str], warnings: list[str]) -> Database:
    messages: dict[tuple[int, bool], Message] = {}
    for database in databases:
        warnings += database.warnings
        here: set[str] = set()
        for key, message in database.messages.items():
            if key in messages:
                warnings.append(
                    f"identifier {key[0]:#x} is {messages[key].name} in an earlier database and {message.name} in "
                    f"{database.source}; the first one is used"
                )
                continue
            name = message.name
            if name in taken:
                name = f"{message.name}@{channel or database.source}"
                warnings.append(f"{database.source}: message {message.name} is called {name}, the name is taken")
            messages[key] = message if name == message.name else replace(message, name=name)
            here.add(name)
        taken |= here
    rates = [one.bit_rate for one in databases if one.bit_rate]
    source = ", ".join(database.source for database in databases)
    return replace(databases[0], source=source, messages=messages, warnings=(), bit_rate=rates[0] if rates else None)

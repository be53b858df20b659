"""Which database describes which channel of a log."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from dbc.database import Database, Message
from dbc.frame import BusName
from hil.log.decode import own_databases

NONE = Database("no database", {}, ())


@dataclass(frozen=True, slots=True)
class Databases:
    """Databases of a log.

    Attributes
    ----------
    general : of every channel that is not named in ``by_channel``; None where those have none.
    by_channel : by channel name.
    warnings : what was odd about them, and between them.
    """

    general: Database | None
    by_channel: Mapping[str, Database] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @classmethod
    def own(cls) -> "Databases":
        """Our own two: bench.dbc for a channel named bench, brake.dbc for all others."""
        ours = own_databases()
        return cls(ours[BusName.VEHICLE.value], {BusName.BENCH.value: ours[BusName.BENCH.value]})

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

    def all(self) -> list[Database]:
        """Every one of them."""
        return [*([self.general] if self.general else []), *self.by_channel.values()]

    def messages(self) -> Iterable[Message]:
        """Every message of every database."""
        for database in self.all():
            yield from database.messages.values()

    def only(self, names: set[str]) -> "Databases":
        """The same without the messages of other names."""
        cut = {id(one): _only(one, names) for one in self.all()}
        general = None if self.general is None else cut[id(self.general)]
        return Databases(general, {name: cut[id(one)] for name, one in self.by_channel.items()}, self.warnings)


def _only(database: Database, names: set[str]) -> Database:
    return replace(database, messages={key: m for key, m in database.messages.items() if m.name in names})


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
    rates = [rate for one in databases if (rate := getattr(one, "bit_rate", None))]
    source = ", ".join(database.source for database in databases)
    joined = replace(databases[0], source=source, messages=messages, warnings=())
    return replace(joined, bit_rate=rates[0]) if rates else joined  # type: ignore[call-arg]

"""One message of a user's database as it is sent: values, counter, check value, cycle."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from dbc.database import Message
from dbc.frame import BusName, Frame
from hil.gateway.protection import Protection
from hil.gateway.signals import Raw, assemble


@dataclass(frozen=True, slots=True)
class Sending:
    """How a message is sent.

    Attributes
    ----------
    message : from the database.
    cycle_ns : 0: only when something of it changes.
    start : raw values by signal.
    protection : None without.
    counter : name of a plain counter signal and its modulus, None without.
    """

    message: Message
    cycle_ns: int
    start: Mapping[str, Raw]
    protection: Protection | None = None
    counter: tuple[str, int] | None = None


@dataclass(slots=True)
class SentMessage:
    """State of a message that is sent.

    Attributes
    ----------
    sending : how.  values : raw values by signal.  count : frames made.
    """

    sending: Sending
    values: dict[str, Raw] = field(init=False)
    count: int = 0
    _slot: int | None = None

    def __post_init__(self) -> None:
        self.values = dict(self.sending.start)

    def due(self, now_ns: int) -> bool:
        """Whether ``now_ns`` is the first tick asked about of a slot of the cycle; a late task never catches up."""
        if not self.sending.cycle_ns:
            return False
        slot = now_ns // self.sending.cycle_ns
        if slot == self._slot:
            return False
        self._slot = slot
        return True

    def frame(self) -> Frame:
        """Frame with the values as they are and the next counter."""
        sending = self.sending
        if sending.counter is not None:
            name, modulus = sending.counter
            self.values[name] = self.count % modulus
        payload = assemble(sending.message, self.values)
        if sending.protection is not None:
            sending.protection.protect(payload, self.count % max(sending.protection.modulus, 1))
        self.count += 1
        return Frame(BusName.VEHICLE, sending.message.can_id, bytes(payload), 0, sending.message.extended)

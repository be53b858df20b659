"""Diagnostic messages of a log, joined from their frames, each with what it says and how it fits to the others."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dbc.isotp import LinkError, PduKind, parse
from dbc.isotp_log import JoinedMessage, Reassembler
from hil.log.frames import FrameFlag, FrameTable
from hil.uds import names
from hil.uds.addresses import Addresses, Identifier, keys_of
from hil.uds.known import FOREIGN, Names
from hil.uds.words import Kind, Said, describe

_CHANNEL_SHIFT = 32


class Spoken(NamedTuple):
    """A message of a log.

    Attributes
    ----------
    start_ns, end_ns : stamps of its first and its last frame.
    channel, identifier : where it was.
    length : bytes that were announced.
    data : the bytes that came.
    said : what it says, of what came.
    error : why it is not complete; None where it is.
    after_ns : time from the end of its request to its begin; None for a request, and where none is known.
    """

    start_ns: int
    end_ns: int
    channel: str
    identifier: Identifier
    length: int
    data: bytes
    said: Said
    error: LinkError | None
    after_ns: int | None


@dataclass(slots=True)
class Counts:
    """What a log held of diagnostics; every frame of its identifiers is in one of the kinds of ``frames``.

    Attributes
    ----------
    frames : by kind: single, first, consecutive, flow control, periodic data, without a first frame,
        not ISO-TP.
    messages : complete ones by kind.
    broken : incomplete ones by reason.
    unanswered : requests to one ECU that want an answer and have none.
    unasked : answers without a request.
    identifiers : messages, complete or not, by channel and identifier.
    """

    frames: Counter[str] = field(default_factory=Counter)
    messages: Counter[Kind] = field(default_factory=Counter)
    broken: Counter[LinkError] = field(default_factory=Counter)
    unanswered: int = 0
    unasked: int = 0
    identifiers: Counter[tuple[str, Identifier]] = field(default_factory=Counter)

    @property
    def lost_frames(self) -> int:
        """Frames that belong to no message."""
        return self.frames[NO_FIRST] + self.frames[NO_ISOTP]

    @property
    def whole(self) -> bool:
        """Nothing is incomplete, and no frame is left over."""
        return not self.broken and not self.lost_frames


NO_FIRST, NO_ISOTP, PERIODIC = "consecutive without a first frame", "not ISO-TP", "periodic data"
_KINDS = {
    PduKind.SINGLE: "single",
    PduKind.FIRST: "first",
    PduKind.CONSECUTIVE: "consecutive",
    PduKind.FLOW: "flow control",
}


class _Request(NamedTuple):
    service: int | None
    end_ns: int
    wanted: bool
    data: bytes


class Conversation:
    """Joins and reads the messages of a log as its frames go by; it holds what is open, not the log.

    Parameters
    ----------
    addresses : identifiers of diagnostics.
    names_of : what is known of the ECU behind an identifier of a channel.
    """

    def __init__(self, addresses: Addresses, names_of: Callable[[str, Identifier], Names] = lambda *_: FOREIGN) -> None:
        self.addresses = addresses
        self.counts = Counts()
        self._names_of = names_of
        self._joiner = Reassembler()
        self._under_way: set[int] = set()  # channels and identifiers inside a segmented message
        self._asked: dict[tuple[int, Identifier], _Request] = {}  # by channel and identifier of the request
        self._asked_all: dict[int, tuple[Identifier, _Request]] = {}
        self._periodic: dict[tuple[int, Identifier], set[int]] = {}  # by channel and identifier of the answer

    def messages(self, tables: Iterable[FrameTable]) -> Iterator[list[Spoken]]:
        """Yield the messages of each table in the order of their last frames, and at the end those that stay open."""
        channels: tuple[str, ...] = ()
        for table in tables:
            channels = table.channels
            keys = keys_of(table.can_id, table.extended)
            data_frame = (table.flags & (FrameFlag.REMOTE | FrameFlag.ERROR)) == 0
            spoken: list[Spoken] = []
            for row in np.flatnonzero(data_frame & self.addresses.among(keys)).tolist():
                key = int(keys[row]) | int(table.channel[row]) << _CHANNEL_SHIFT
                data = table.data[row, : table.length[row]].tobytes()
                spoken += self._take(int(table.time_ns[row]), key, data, channels)
            if spoken:
                yield spoken
        last = [self._read(one, channels) for one in self._joiner.end()]
        self.counts.unanswered += sum(one.wanted for one in self._asked.values())
        if last:
            yield last

    def _take(self, time_ns: int, key: int, data: bytes, channels: tuple[str, ...]) -> list[Spoken]:
        if data and Identifier.of_key(key & ((1 << _CHANNEL_SHIFT) - 1)) in self.addresses.periodic:
            self.counts.frames[PERIODIC] += 1
            return [self._read(JoinedMessage(key, time_ns, time_ns, len(data), data), channels)]
        pdu = parse(data)
        under_way = key in self._under_way
        joined = self._joiner.take(time_ns, key, data)
        late = bool(joined) and joined[0].error is LinkError.N_TIMEOUT_CR
        for one in joined:
            self._under_way.discard(one.can_id)
        if pdu is None:
            self.counts.frames[NO_ISOTP] += 1
        elif pdu.kind is PduKind.CONSECUTIVE and (late or not under_way):
            self.counts.frames[NO_FIRST] += 1
        else:
            self.counts.frames[_KINDS[pdu.kind]] += 1
            if pdu.kind is PduKind.FIRST:
                self._under_way.add(key)
        return [self._read(one, channels) for one in joined]

    def _read(self, joined: JoinedMessage, channels: tuple[str, ...]) -> Spoken:
        """A message in words, fitted to the requests so far."""
        place, key = joined.can_id >> _CHANNEL_SHIFT, joined.can_id & ((1 << _CHANNEL_SHIFT) - 1)
        identifier = Identifier.of_key(key)
        said = self._say(joined, place, channels[place], identifier)
        after_ns = None
        if joined.error is None:
            self.counts.messages[said.kind] += 1
            if said.kind is Kind.REQUEST:
                self._ask(joined, place, identifier, said)
            elif said.kind is not Kind.OTHER:
                after_ns = self._answer(joined, place, identifier, said)
        else:
            self.counts.broken[joined.error] += 1
        self.counts.identifiers[channels[place], identifier] += 1
        return Spoken(
            joined.start_ns,
            joined.end_ns,
            channels[place],
            identifier,
            joined.length,
            joined.data,
            said,
            joined.error,
            after_ns,
        )

    def _say(self, joined: JoinedMessage, place: int, channel: str, identifier: Identifier) -> Said:
        known = self._names_of(channel, identifier)
        if identifier in self.addresses.periodic:
            return Said(Kind.OTHER, names.READ_PERIODICALLY, known.periodic_text(joined.data))
        low = joined.data[0] if joined.data else -1
        if low in self._periodic.get((place, identifier), ()) and not self._is_due(joined.data, place, identifier):
            return Said(Kind.OTHER, names.READ_PERIODICALLY, known.periodic_text(joined.data))
        return describe(joined.data, known)

    def _is_due(self, data: bytes, place: int, identifier: Identifier) -> bool:
        """Whether a message answers the request that is open: of the same first byte, it is no periodic data then."""
        partner = self.addresses.partner(identifier)
        asked = None if partner is None else self._asked.get((place, partner))
        return asked is not None and asked.wanted and asked.service == describe(data).service

    def _ask(self, joined: JoinedMessage, place: int, identifier: Identifier, said: Said) -> None:
        with_sub = said.service in names.WITH_SUBFUNCTION and len(joined.data) > 1
        quiet = with_sub and bool(joined.data[1] & names.SUPPRESS_BIT)
        if self.addresses.is_functional(identifier):
            self._asked_all[place] = identifier, _Request(said.service, joined.end_ns, False, joined.data)
            return
        before = self._asked.get((place, identifier))
        if before is not None and before.wanted:
            self.counts.unanswered += 1
        self._asked[place, identifier] = _Request(said.service, joined.end_ns, not quiet, joined.data)

    def _answer(self, joined: JoinedMessage, place: int, identifier: Identifier, said: Said) -> int | None:
        partner = self.addresses.partner(identifier)
        asked = None if partner is None else self._asked.get((place, partner))
        if partner is not None and asked is not None and asked.service == said.service:
            if said.kind is not Kind.PENDING:
                self._asked[place, partner] = asked._replace(wanted=False)
                if said.kind is Kind.ANSWER and said.service == names.READ_PERIODICALLY:
                    self._send_periodically((place, identifier), asked.data)
            return joined.start_ns - asked.end_ns
        to_all = self._asked_all.get(place)
        if to_all is not None and to_all[1].service == said.service:
            return joined.start_ns - to_all[1].end_ns
        self.counts.unasked += 1
        return None

    def _send_periodically(self, where: tuple[int, Identifier], request: bytes) -> None:
        """Take note of the periodic data that a request begins or ends; without identifiers the end is that of all."""
        active = self._periodic.setdefault(where, set())
        if request[1:2] != bytes((names.STOP_SENDING,)):
            active.update(request[2:])
        elif len(request) > 2:
            active.difference_update(request[2:])
        else:
            active.clear()

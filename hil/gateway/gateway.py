"""A gateway between our vehicle bus and somebody else's: two nodes without I/O, one for each way.

Nothing is passed on that is not fresh: a message is sent while all its sources are, and falls silent with them, so that
the receivers' own supervision finds what it would find without a gateway, later by at most the age allowed here.
"""

import math
from collections.abc import Callable, Sequence

from dbc.exchange import Receiver, Transmitter
from dbc.frame import BusName, Frame, LinkEvent, Node, Received
from hil.gateway.map import FromOurs, FromTheirs, GatewayMap, Heard, ToOurs, ToTheirs
from hil.gateway.protection import Sequence as CounterSequence
from hil.gateway.sent import SentMessage
from hil.gateway.signals import Raw, physical, raw_of, read, selected

Say = Callable[[str], None]


def _quiet(_: str) -> None:
    """Say nothing."""


class TheirSide:
    """Takes the frames of our bus and gives those of theirs.

    Parameters
    ----------
    gateway_map : the map.
    say : takes, for people, which message begins to be sent, or is held back and why.

    Attributes
    ----------
    names : messages that it sends, by identifier and whether it is extended.
    """

    def __init__(self, gateway_map: GatewayMap, say: Say = _quiet) -> None:
        self._messages = [(one, SentMessage(one.sending)) for one in gateway_map.theirs]
        types = dict.fromkeys(source.spec.type for one in gateway_map.theirs for source in one.sources)
        self._receiver = Receiver(types)
        self._why: dict[str, str] = {}
        self._say = say
        sending = [one.sending.message for one in gateway_map.theirs]
        self.names = {(message.can_id, message.extended): message.name for message in sending}

    @property
    def sent(self) -> int:
        """Frames sent so far."""
        return sum(message.count for _, message in self._messages)

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Frame]:
        """Frames for their bus at ``now_ns``, out of the inbox of ours."""
        if inbox:
            self._receiver.accept(now_ns, inbox)
        frames = []
        for plan, message in self._messages:
            if message.due(now_ns):
                why = self._fill(plan, message.values, now_ns)
                name = plan.sending.message.name
                if why != self._why.get(name):
                    self._why[name] = why
                    self._say(f"{name}: {f'held back, {why}' if why else 'sent'}")
                if not why:
                    frames.append(message.frame())
        return frames

    def _fill(self, plan: ToTheirs, values: dict[str, Raw], now_ns: int) -> str:
        """Write the values of our signals; why the message is to be held back, empty where it is not."""
        for source in plan.sources:
            age_ns = self._receiver.age_ns(source.spec.type, now_ns)
            if age_ns is None:
                return f"{source.spec.name} has not come yet"
            if age_ns > plan.oldest_ns[source.spec.name]:
                return f"{source.spec.name} is silent"
            raw = _theirs(source, self._receiver.latest(source.spec.type))
            if raw is None:
                return f"{source.spec.fields[source.index].name} is not available"
            values[source.signal.name] = raw
        return ""


def _theirs(source: FromOurs, message: tuple[float | None, ...] | None) -> Raw | None:
    value = None if message is None else message[source.index]
    if value is None:
        return source.none
    conversion = source.conversion
    if conversion.above is not None:
        return int(value > conversion.above)
    return raw_of(source.signal, (value - conversion.offset) / conversion.factor)


class _Hearing:
    """Last usable frame of one message of theirs."""

    def __init__(self, heard: Heard) -> None:
        self.heard = heard
        modulus = heard.counter[1] if heard.counter is not None else getattr(heard.protection, "modulus", 0)
        self._sequence = CounterSequence(modulus) if modulus else None
        self.payload: bytes | None = None
        self.last_ns = 0
        self.rejected = 0

    def take(self, now_ns: int, payload: bytes) -> None:
        """Take a frame; one of wrong length, check value or counter counts as rejected."""
        heard = self.heard
        sound = len(payload) == heard.message.length and (heard.protection is None or heard.protection.sound(payload))
        if sound and (self._sequence is None or self._sequence.usable(self._counter(payload))):
            self.payload, self.last_ns = payload, now_ns
        else:
            self.rejected += 1

    def _counter(self, payload: bytes) -> int:
        if self.heard.counter is not None:
            return int(read(self.heard.counter[0], payload))
        assert self.heard.protection is not None
        return self.heard.protection.counter(payload)

    def fresh(self, now_ns: int) -> bool:
        """Whether it may be passed on."""
        return self.payload is not None and now_ns - self.last_ns <= self.heard.oldest_ns


class OurSide:
    """Takes the frames of their bus and gives those of ours; parameters and attributes as of `TheirSide`."""

    def __init__(self, gateway_map: GatewayMap, say: Say = _quiet) -> None:
        self._plans = gateway_map.ours
        self._hearing = {(one.message.can_id, one.message.extended): _Hearing(one) for one in gateway_map.heard}
        self._by_name = {one.heard.message.name: one for one in self._hearing.values()}
        self._transmitter = Transmitter()
        self.names = {(one.spec.can_id, False): one.spec.name for one in gateway_map.ours}
        self._why: dict[str, str] = {}
        self._say = say
        self.sent = 0

    @property
    def rejected(self) -> int:
        """Frames of theirs with a wrong length, check value or counter so far."""
        return sum(one.rejected for one in self._hearing.values())

    def step(self, now_ns: int, inbox: Sequence[Received]) -> list[Frame]:
        """Frames for our bus at ``now_ns``, out of the inbox of theirs."""
        for item in inbox:
            if not isinstance(item, LinkEvent):
                hearing = self._hearing.get((item.can_id, item.extended))
                if hearing is not None:
                    hearing.take(now_ns, item.data)
        messages = []
        for plan in self._plans:
            if not self._transmitter.due(plan.spec.type, now_ns):
                continue
            values, why = self._values(plan, now_ns)
            if why != self._why.get(plan.spec.name):
                self._why[plan.spec.name] = why
                self._say(f"{plan.spec.name}: {f'held back, {why}' if why else 'sent'}")
            if not why:
                messages.append(tuple.__new__(plan.spec.type, values))
        self.sent += len(messages)
        return self._transmitter.frames(now_ns, messages)

    def _values(self, plan: ToOurs, now_ns: int) -> tuple[list[float | None], str]:
        values: list[float | None] = []
        for field, source in zip(plan.spec.fields, plan.fields, strict=True):
            if not isinstance(source, FromTheirs):
                values.append(source)
                continue
            hearing = self._by_name[source.heard.message.name]
            if not hearing.fresh(now_ns) or hearing.payload is None:
                came = "has not come yet" if hearing.payload is None else "is silent or rejected"
                return [], f"{source.heard.message.name} {came}"
            value = _ours(source, hearing.payload)
            if value is None and field.sna is None:
                return [], f"{source.signal.name} is not available"
            values.append(value)
        return values, ""


def _ours(source: FromTheirs, payload: bytes) -> float | None:
    raw = read(source.signal, payload)
    if raw == source.none or not selected(source.heard.message, source.signal, payload):
        return None
    value = physical(source.signal, raw) * source.conversion.factor + source.conversion.offset
    return value if math.isfinite(value) else None


class BehindGateway:
    """A node of ours as their bus sees it, in one process and in virtual time.

    Parameters
    ----------
    node : speaks our messages; its frames of the bench bus pass as they are.
    gateway_map : the map.
    period_ns, phase_ns : of the node's ticks; this one may be stepped more often.
    """

    def __init__(self, node: Node, gateway_map: GatewayMap, period_ns: int = 10_000_000, phase_ns: int = 0) -> None:
        self._node = node
        self._period_ns, self._phase_ns = period_ns, phase_ns
        self.their_side, self.our_side = TheirSide(gateway_map), OurSide(gateway_map)
        self._inbox: list[Received] = []

    def step(self, now_ns: int, inbox: list[Received]) -> list[Frame]:
        """Frames for their bus, and the node's for the bench bus."""
        self._inbox += [item for item in inbox if item.bus is BusName.BENCH]
        self._inbox += self.our_side.step(now_ns, [item for item in inbox if item.bus is BusName.VEHICLE])
        frames: list[Frame] = []
        if (now_ns - self._phase_ns) % self._period_ns == 0:
            came, self._inbox = self._inbox, []
            frames = self._node.step(now_ns, came)
        ours: list[Received] = [frame for frame in frames if frame.bus is BusName.VEHICLE]
        return self.their_side.step(now_ns, ours) + [frame for frame in frames if frame.bus is BusName.BENCH]

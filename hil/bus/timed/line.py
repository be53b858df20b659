"""Nodes in virtual time whose vehicle bus is a timed one: `hil.rt.lockstep` with bit times between them."""

import heapq
from collections.abc import Container, Iterator, Sequence

from dbc.frame import BusName, Frame, LinkEvent, Received
from hil.bus.bus import BusError, parse_spec
from hil.bus.timed.bus import TimedBus
from hil.bus.timed.controller import Controller, Reception
from hil.bus.timed.wire import WireFrame
from hil.rt.lockstep import Member, Step

KIND = "timed"
_OPTIONS = "bit_error_rate=1e-6, queue=priority or queue=fifo"


def is_timed(spec: str) -> bool:
    """Whether a bus is named as a timed one."""
    return spec.partition(":")[0].partition(",")[0] == KIND


def open_line(spec: str, bit_rate: int, seed: int) -> "TimedLine":
    """Make the line that ``timed[:BITRATE][,bit_error_rate=P][,queue=fifo]`` names.

    Parameters
    ----------
    bit_rate : where the name gives none, bit/s.
    seed : of the bit errors.

    Raises
    ------
    BusError : not of that form.
    """
    name, _, rest = spec.partition(",")
    parsed = parse_spec(f"{name if ':' in name else f'{KIND}:{bit_rate}'}{',' * bool(rest)}{rest}")
    options = dict(parsed.options)
    error_rate, queue = options.pop("bit_error_rate", 0.0), options.pop("queue", "priority")
    if not parsed.channel.isdigit() or not 1_000 <= int(parsed.channel) <= 8_000_000:
        raise BusError(f"bus {spec!r}: expected a bit rate from 1000 to 8000000 bit/s, as timed:500000")
    if options:
        raise BusError(f"bus {spec!r}: no option {', '.join(options)}; a timed bus has {_OPTIONS}")
    if isinstance(error_rate, str | bool) or not 0.0 <= error_rate < 1.0:
        raise BusError(f"bus {spec!r}: bit_error_rate is a probability from 0 to below 1, got {error_rate}")
    if queue not in ("priority", "fifo"):
        raise BusError(f"bus {spec!r}: queue is priority or fifo, got {queue}")
    return TimedLine(TimedBus(int(parsed.channel), bit_error_rate=error_rate, seed=seed), fifo=queue == "fifo")


class TimedLine:
    """The vehicle bus of nodes in virtual time; the bench bus stays without delay.

    Parameters
    ----------
    bus : the vehicle bus; every node gets one controller of it.
    fifo : their transmit queues are in order of asking.

    Attributes
    ----------
    controllers : of each member, in order; empty before the first step.
    """

    def __init__(self, bus: TimedBus, fifo: bool = False) -> None:
        self.bus = bus
        self.controllers: list[Controller] = []
        self._fifo = fifo
        self._ear: Controller | None = None
        self._heard: list[Received] = []

    @property
    def spec(self) -> str:
        """Its name."""
        return f"{KIND}:{self.bus.bit_rate}"

    @property
    def note(self) -> str:
        """What it is, for people."""
        queue = "FIFO" if self._fifo else "priority"
        return f"virtual time, {self.bus.bit_rate / 1e3:g} kbit/s, {queue} queues"

    def lockstep(self, members: Sequence[Member], listening: Container[int] = ()) -> Iterator[Step]:
        """Step the members for ever, as `hil.rt.lockstep.lockstep`; `heard` says what a recorder hears.

        Parameters
        ----------
        members : one controller each.
        listening : those of them, by index, that acknowledge nothing until they send a frame for the first time.

        Notes
        -----
        A frame of the vehicle bus reaches the others when its end of frame has passed on the wire, with that time; a
        controller's link events reach its own node.
        """
        self._ear = self.bus.join("recorder", listen_only=True)
        self.controllers = [
            self.bus.join(f"node {k}", fifo=self._fifo, listen_only=k in listening) for k in range(len(members))
        ]
        inboxes: list[list[Received]] = [[] for _ in members]
        due = [(member.phase_ns, index) for index, member in enumerate(members)]
        heapq.heapify(due)
        while due:
            now_ns = due[0][0]
            self.bus.advance(now_ns)
            self._heard += [one for one in _frames(self._ear) if isinstance(one, Frame)]
            sent: list[Step] = []
            while due and due[0][0] == now_ns:
                _, index = heapq.heappop(due)
                arrived = _frames(self.controllers[index])
                if index not in listening:
                    self._heard += [one for one in arrived if isinstance(one, LinkEvent)]
                inbox, inboxes[index] = arrived + inboxes[index], []
                sent.append(Step(now_ns, index, members[index].node.step(now_ns, inbox)))
                heapq.heappush(due, (now_ns + members[index].period_ns, index))
            for step in sent:
                self._send(step, inboxes)
                yield step

    def heard(self) -> list[Received]:
        """Return what a recorder has heard since the last call: frames with the times of their ends, link events."""
        heard, self._heard = self._heard, []
        return heard

    def _send(self, step: Step, inboxes: list[list[Received]]) -> None:
        for frame in step.frames:
            if frame.bus is self.bus.name:
                wire = WireFrame(frame.can_id, frame.data, frame.extended)
                controller = self.controllers[step.member]
                controller.listen_only = False
                controller.send(wire, step.now_ns)
                continue
            self._heard.append(frame._replace(time_ns=step.now_ns))
            for index, inbox in enumerate(inboxes):
                if index != step.member:
                    inbox.append(frame)


def _frames(controller: Controller) -> list[Received]:
    """What a controller received, as a node takes it; a classical data frame is all that it knows."""
    return [
        Frame(BusName.VEHICLE, one.frame.can_id, one.frame.data, one.time_ns, one.frame.extended)
        if isinstance(one, Reception)
        else one
        for one in controller.receive()
        if isinstance(one, LinkEvent) or not (one.frame.fd or one.frame.remote)
    ]

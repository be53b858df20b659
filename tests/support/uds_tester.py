"""A tester in virtual time: udsoncan's client over our ISO-TP link, each tick of the bench stepped while it waits."""

from collections import deque
from collections.abc import Callable

from udsoncan import AsciiCodec
from udsoncan.client import Client
from udsoncan.connections import BaseConnection

from dbc.diagnostic_ids import PADDING, PERIODIC, REQUEST, REQUEST_FUNCTIONAL, RESPONSE
from dbc.frame import BusName, Frame
from dbc.isotp import Link
from ecu.diagnostics.actuators import DEMANDS
from ecu.diagnostics.identifiers import IDENTIFIERS
from ecu.diagnostics.security import key_of

TICK_NS = 10_000_000


def codec(identifier):
    return AsciiCodec(identifier.size) if identifier.form == "text" else identifier.form


CONFIG = {
    "data_identifiers": {
        **{did: codec(one) for did, one in IDENTIFIERS.items()},
        0xF186: "B",
        **dict.fromkeys(DEMANDS, ">f"),
    },
    "input_output": dict.fromkeys(DEMANDS, ">f"),
    "extended_data_size": {},
    "security_algo": lambda level, seed, params: key_of(bytes(seed)),
    "standard_version": 2020,
}


class VirtualConnection(BaseConnection):
    """``tick`` takes the tester's frames, steps the bench by 10 ms and returns what the ECU sent."""

    def __init__(self, tick: Callable[[list[Frame]], list[Frame]], request_id: int = REQUEST, **link) -> None:
        super().__init__("virtual")
        self._tick, self._id = tick, request_id
        self.link = Link(padding=PADDING, **link)
        self.now_ns = 0
        self.answers: deque[bytes] = deque()
        self.answered_ns: deque[int] = deque()
        self.periodic: list[bytes] = []

    def step(self, ticks: int = 1) -> list[Frame]:
        sent: list[Frame] = []
        for _ in range(ticks):
            out = [Frame(BusName.VEHICLE, self._id, data) for data in self.link.frames(self.now_ns)]
            sent = self._tick(out)
            self.now_ns += TICK_NS
            for frame in sent:
                if frame.can_id == RESPONSE:
                    answer = self.link.take(self.now_ns, frame.data)
                    if answer is not None:
                        self.answers.append(answer)
                        self.answered_ns.append(self.now_ns)
                elif frame.can_id == PERIODIC:
                    self.periodic.append(frame.data)
        return sent

    def ask(self, text: str, ticks: int = 30) -> list[str]:
        """Send a request in hexadecimal, wait, and return every answer."""
        self.answers.clear()
        self.link.send(self.now_ns, bytes.fromhex(text))
        self.step(ticks)
        return [answer.hex(" ") for answer in self.answers]

    def specific_send(self, payload, timeout=None):
        self.answers.clear()
        self.answered_ns.clear()
        self.link.send(self.now_ns, payload)

    def specific_wait_frame(self, timeout=None):
        until_ns = self.now_ns + int(timeout * 1e9)
        while not self.answers:
            if self.now_ns >= until_ns:
                raise TimeoutError("no answer in virtual time")
            self.step()
        return self.answers.popleft()

    def empty_rxqueue(self):
        self.answers.clear()

    def open(self):
        return self

    def close(self):
        pass

    def is_open(self):
        return True


def functional(connection: VirtualConnection, text: str, ticks: int = 5) -> list[str]:
    """Answers to a single frame that is sent to everybody."""
    connection.answers.clear()
    request = bytes.fromhex(text)
    data = (bytes((len(request),)) + request).ljust(8, b"\xcc")
    held, connection._tick = (
        connection._tick,
        lambda out: held([*out, Frame(BusName.VEHICLE, REQUEST_FUNCTIONAL, data)]),
    )
    connection.step()
    connection._tick = held
    connection.step(ticks - 1)
    return [answer.hex(" ") for answer in connection.answers]


def client_over(connection: BaseConnection, **changes) -> Client:
    return Client(connection, config={**CONFIG, **changes})

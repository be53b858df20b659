"""A foreign ECU on a bus: it answers by a table, as ISO 14229-1 says, and keeps what it was asked."""

import threading

from dbc.frame import BusName, Frame
from dbc.isotp import Link
from hil.bus.open import open_bus
from hil.rt.clock import monotonic_ns

ANSWERS = {
    "3e 00": ["7e 00"],
    "10 03": ["50 03 00 32 01 f4"],
    "14 ff ff ff": ["54"],
    "22 f1 90": ["62 f1 90" + b"WAUZZZ4M1HA000001".hex()],
    "22 01 23": ["62 01 23" + 600 * "a5"],
    "22 02 00": ["7f 22 78", "7f 22 78", "62 02 00 01"],
    "22 03 00": ["62 f1 90 00"],  # of something else
    "19 02 0d": ["59 02 ff 51 23 1f 2f c1 00 00 08"],
    "19 0a": ["59 0a ff 51 23 1f 2f"],
    "19 04 51 23 1f ff": ["59 04 51 23 1f 2f 01 01 f1 90 41 42 43"],
    "19 06 51 23 1f ff": ["7f 19 31"],
    "2a 01 01": ["6a"],
    "24 f1 90": ["64 f1 90 01"],
    "2e 01 00 0a 0b": ["6e 01 00"],
    "31 01 02 03": ["71 01 02 03 00"],
    "2f 01 00 03 7f": ["6f 01 00 03 7f"],
    "2f 01 00 00": ["6f 01 00 00"],
    "11 01": ["51 01"],
    "2e 01 00" + 40 * "55": ["6e 01 00"],
}


class ForeignEcu:
    """Answers in a thread of its own until closed; what its table does not hold is refused with 0x11, or in silence."""

    def __init__(self, bus, request, answer, functional=None, silent=False):
        self.asked = []
        self._table = {bytes.fromhex(k): [bytes.fromhex(one) for one in v] for k, v in ANSWERS.items()}
        self._ids, self._functional, self._silent = (request, answer), functional, silent
        self._bus, self._end = open_bus(bus, BusName.VEHICLE), threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()
        self._bus.close()

    def _serve(self):
        link, waiting = Link(padding=0xAA), []
        request_id, answer_id = self._ids
        while not self._end.is_set():
            for frame in self._bus.receive(0.002):
                if isinstance(frame, Frame) and frame.can_id in (request_id, self._functional):
                    message = link.take(monotonic_ns(), frame.data)
                    if message is not None:
                        self.asked.append(message)
                        waiting += self._answers(message)
            if waiting and not link.sending:
                link.send(monotonic_ns(), waiting.pop(0))
            frames = link.frames(monotonic_ns())
            self._bus.send([Frame(BusName.VEHICLE, answer_id, data, 0, answer_id > 0x7FF) for data in frames])

    def _answers(self, message):
        if self._silent or message == b"\x3e\x80":
            return []
        return self._table.get(message, [bytes((0x7F, message[0], 0x11))])

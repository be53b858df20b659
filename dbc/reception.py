"""What one received message is worth: its check, its place in the sequence, its place in time.

The counter 0..14 alone takes any stream for fresh that counts on, however old it is and whoever sends it. The cycle
time of the contract tells more: which counter is due at a time, and how many frames may come.
"""

from dbc.contract import Message, MessageSpec
from dbc.e2e import COUNTER_MODULUS, Checker, Status

# found faster than the enum's attributes: the way of every frame
_OK, _OK_SOME_LOST, _SYNC, _REPEATED = Status.OK, Status.OK_SOME_LOST, Status.SYNC, Status.REPEATED
_WRONG_SEQUENCE, _WRONG_CRC = Status.WRONG_SEQUENCE, Status.WRONG_CRC
MOST_LATE_CYCLES = 5  # a sender that is later does not catch up: 30 ms of a late node and two of its cycles
FORGOTTEN_IN = 50  # lateness is forgotten by 2 % of the time: a sender's clock may be as much too fast
_QUEUE_NS = -(1 << 62)  # what has waited before the first tick all comes at once
SILENT_CYCLES = COUNTER_MODULUS  # without any frame for the counter's length, any counter may follow
ADOPTED_CYCLES = 1000  # 10 s at 10 ms, longer than a stop: a sender that restarted within the counter's length


class Reception:
    """State of one received message.

    A message with a cycle time is watched in time, too: see `_judge`.

    Attributes
    ----------
    message : the last usable message, None before the first.
    fresh : whether the last call of `Receiver.accept` brought a usable one.
    valid_in_row : usable frames since the last unusable one.
    bad_in_row : unusable frames since the last usable one.
    last_valid_ns : tick of the last usable frame, None before the first.
    odd_ns : tick of the three counts below, -1 before any.
    bad : frames in that tick with a wrong check value or length, or with the bytes of the frame before.
    foreign : valid frames in that tick that this stream cannot have brought.
    doubled : frames in that tick that came twice.
    """

    def __init__(self, spec: MessageSpec) -> None:
        self.spec = spec
        self.checker = None if spec.data_id is None else Checker(spec.data_id, spec.length)
        self._check = self._check_length if self.checker is None else self.checker.check
        self._decode = spec.decode
        self.message: Message | None = None
        self.status = Status.NO_NEW_DATA
        self.fresh = False
        self.valid_in_row = 0
        self.bad_in_row = 0
        self.last_valid_ns: int | None = None
        self.odd_ns = -1
        self.bad = self.foreign = self.doubled = 0
        self._cycle_ns = 0 if self.checker is None else spec.cycle_ns
        self._usual_ns = self._cycle_ns  # -1 while frames are refused: each is then judged
        self._known_ns = 0  # tick of the last frame that belongs to the stream, and its bytes
        self._known = b""
        self._ahead_ns = 0  # by its counter, of its earliest phase so far; at most 0, negative where late
        self._judged_ns = 0  # tick for which that holds
        self._stray_ns = self._stray_since_ns = self._stray_counter = -1

    def accept(self, now_ns: int, data: bytes) -> None:
        """Check one payload and keep its message when it is usable."""
        status = self._check(data)
        if (status is not _OK or now_ns - self._known_ns != self._usual_ns) and self._cycle_ns:
            status = self._judge(now_ns, data, status)
        self.status = status
        if status is _OK or status is _OK_SOME_LOST:
            self.message = self._decode(data)
            self.fresh = True
            self.valid_in_row += 1
            self.bad_in_row = 0
            self.last_valid_ns = self._known_ns = now_ns
            self._known = data
        elif status is not _REPEATED or self._known_ns != now_ns or data != self._known:
            self.valid_in_row = 0
            self.bad_in_row += 1

    def _judge(self, now_ns: int, data: bytes, status: Status) -> Status:
        """Hold a frame against the time, where its check or its time is not the usual.

        One sender's counter advances by one a cycle. Frames may be lost, late (then several come at once) or cease for
        any time; a counter that leaps without time for the frames between, or goes back, is not that sender's. Such
        frames are refused until the counter fits the time again (by a cycle), until `SILENT_CYCLES` without any frame,
        or until the new counter has lived alone for `ADOPTED_CYCLES`.
        """
        if status is _WRONG_CRC:
            self._note(now_ns, bad=1)
            return status
        cycle_ns, counter = self._cycle_ns, data[1] & 0x0F
        since_ns = now_ns - self._known_ns
        if status is _SYNC:
            return self._begin(now_ns, data, status)
        known = self._known[1] & 0x0F
        step = (counter - known) % COUNTER_MODULUS
        if step == 0:
            if self._usual_ns < 0:
                self._note(now_ns, foreign=1)
            elif data == self._known:
                self._note(now_ns, **({"bad": 1} if 2 * since_ns >= cycle_ns else {"doubled": 1}))
            elif since_ns < SILENT_CYCLES * cycle_ns:
                self._note(now_ns, foreign=1)  # the same counter with other bytes
            return status
        late_ns = self._ahead_ns
        if now_ns != self._judged_ns:
            late_ns = max(late_ns, -MOST_LATE_CYCLES * cycle_ns) + (now_ns - self._judged_ns) // FORGOTTEN_IN
            late_ns = min(late_ns, 0)
        ahead_ns = late_ns + step * cycle_ns - since_ns
        if self._usual_ns < 0:  # frames of another counter came since
            gap = (since_ns - step * cycle_ns + cycle_ns) % (COUNTER_MODULUS * cycle_ns)
            fits = gap <= 2 * cycle_ns
            ahead_ns = min(ahead_ns, 0)
        elif status is _WRONG_SEQUENCE:
            fits = ahead_ns <= cycle_ns
        else:
            fits = step == 1 or 2 * ahead_ns <= cycle_ns
        if fits:
            if 2 * ahead_ns > cycle_ns and status is not _WRONG_SEQUENCE:
                self._note(now_ns, foreign=1)  # more frames than cycles
            self._ahead_ns, self._judged_ns = min(ahead_ns, 0), now_ns
            self._usual_ns = cycle_ns
            self._known_ns, self._known = now_ns, data
            return status
        silent_ns = now_ns - max(self._known_ns, self._stray_ns)
        if silent_ns >= SILENT_CYCLES * cycle_ns or self._adopted(now_ns, counter):
            return self._begin(now_ns, data, _WRONG_SEQUENCE)
        self._note(now_ns, foreign=1)
        assert self.checker is not None
        self.checker.counter = known  # it goes on from the frames that are believed
        self.checker.lost -= step - 1
        self._usual_ns = -1
        return _WRONG_SEQUENCE

    def _begin(self, now_ns: int, data: bytes, status: Status) -> Status:
        """Follow a stream from this frame on."""
        self._ahead_ns, self._judged_ns = _QUEUE_NS, now_ns
        self._usual_ns = self._cycle_ns
        self._known_ns, self._known = now_ns, data
        return status

    def _adopted(self, now_ns: int, counter: int) -> bool:
        """Whether the refused frames are one stream that has lived long enough alone; remembers this one."""
        step = (counter - self._stray_counter) % COUNTER_MODULUS
        goes_on = self._stray_ns > self._known_ns and 1 <= step <= 3
        if not goes_on:
            self._stray_since_ns = now_ns
        self._stray_ns, self._stray_counter = now_ns, counter
        return now_ns - self._stray_since_ns >= ADOPTED_CYCLES * self._cycle_ns

    def _note(self, now_ns: int, bad: int = 0, foreign: int = 0, doubled: int = 0) -> None:
        if self.odd_ns != now_ns:
            self.odd_ns = now_ns
            self.bad = self.foreign = self.doubled = 0
        self.bad += bad
        self.foreign += foreign
        self.doubled += doubled

    def _check_length(self, data: bytes) -> Status:
        return Status.OK if len(data) == self.spec.length else Status.WRONG_CRC

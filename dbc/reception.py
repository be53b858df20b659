"""What one received message is worth: its check, its place in the sequence, its place in time.

The counter 0..14 alone takes any stream for fresh that counts on, however old it is and whoever sends it. The cycle
time of the contract tells more: which counter is due at a time, and how many frames may come.
"""

from dbc.compiled import PAYLOAD
from dbc.contract import Message
from dbc.e2e import COUNTER_MODULUS, Checker, Status
from dbc.intake import (
    BAD_IN_ROW,
    COUNTER,
    FRESH,
    IN_SEQUENCE,
    KNOWN,
    KNOWN_NS,
    LAST_VALID_NS,
    NO_COUNTER,
    RECEIVED,
    USUAL_NS,
    VALID_IN_ROW,
    WELL,
    WORD,
    Intake,
)

# found faster than the enum's attributes: the way of every frame
_OK, _OK_SOME_LOST, _SYNC, _REPEATED = Status.OK, Status.OK_SOME_LOST, Status.SYNC, Status.REPEATED
_WRONG_SEQUENCE, _WRONG_CRC = Status.WRONG_SEQUENCE, Status.WRONG_CRC
MOST_LATE_CYCLES = 5  # a sender that is later does not catch up: 30 ms of a late node and two of its cycles
FORGOTTEN_IN = 50  # lateness is forgotten by 2 % of the time: a sender's clock may be as much too fast
_QUEUE_NS = -(1 << 62)  # what has waited before the first tick all comes at once
SILENT_CYCLES = COUNTER_MODULUS  # without any frame for the counter's length, any counter may follow
ADOPTED_CYCLES = 1000  # 10 s at 10 ms, longer than a stop: a sender that restarted within the counter's length


class _Number:
    """A number of a reception that is in the memory which compiled code counts in, too."""

    def __init__(self, place: int) -> None:
        self._place = place

    def __get__(self, reception: "Reception", _: type["Reception"]) -> int:
        return reception.memory[self._place]

    def __set__(self, reception: "Reception", value: int) -> None:
        reception.memory[self._place] = value


class Reception:
    """State of one received message; judges the frames that `dbc.intake` does not find usual.

    A message with a cycle time is watched in time, too: see `_judge`.

    Attributes
    ----------
    spec, index : the message, and its place among those of the receiver.
    memory : numbers that compiled code counts in, too, by the places of `dbc.intake`.
    valid_in_row : usable frames since the last unusable one.
    bad_in_row : unusable frames since the last usable one.
    odd_ns : tick of the three counts below, -1 before any.
    bad : frames in that tick with a wrong check value or length, or with the bytes of the frame before.
    foreign : valid frames in that tick that this stream cannot have brought.
    doubled : frames in that tick that came twice.
    """

    valid_in_row, bad_in_row = _Number(VALID_IN_ROW), _Number(BAD_IN_ROW)
    _usual_ns = _Number(USUAL_NS)  # -1 while frames are refused: each is then judged
    _known_ns = _Number(KNOWN_NS)  # tick of the last frame that belongs to the stream

    def __init__(self, intake: Intake, index: int) -> None:
        self.spec, self.index, self.memory = intake.specs[index], index, intake.memory[index]
        spec = self.spec
        self.checker = None if spec.data_id is None else Checker(spec.data_id, spec.length)
        self._check = self._check_length if self.checker is None else self.checker.check
        self._intake = intake
        self._decoded: tuple[int, Message | None] = (0, None)  # a word and what it says
        self.odd_ns = -1
        self.bad = self.foreign = self.doubled = 0
        self._cycle_ns = 0 if self.checker is None else spec.cycle_ns
        self._usual_ns = self._cycle_ns
        self._ahead_ns = 0  # by its counter, of its earliest phase so far; at most 0, negative where late
        self._judged_ns = 0  # tick for which that holds
        self._steady_ns = self._steady_counter = -1  # last frame of the last long run of them
        self._stray_ns = self._stray_since_ns = self._stray_counter = -1

    @property
    def message(self) -> Message | None:
        """The last usable message, None before the first."""
        if not self.memory[RECEIVED]:
            return None
        word = self.memory[WORD]
        if word != self._decoded[0] or self._decoded[1] is None:
            self._decoded = word, self.spec.decode(_bytes(word)[: self.spec.length])
        return self._decoded[1]

    @property
    def fresh(self) -> bool:
        """Whether the last call of `Receiver.accept` brought a usable message."""
        return bool(self.memory[FRESH])

    @property
    def last_valid_ns(self) -> int | None:
        """Tick of the last usable frame, None before the first."""
        return self.memory[LAST_VALID_NS] if self.memory[RECEIVED] else None

    @property
    def counter(self) -> int | None:
        """Last alive counter consumed, None before the first."""
        counter = self.memory[COUNTER]
        return None if counter == NO_COUNTER else counter

    def accept(self, now_ns: int, data: bytes) -> None:
        """Check one payload and keep its message when it is usable."""
        if self.checker is not None:
            self.checker.counter = self.counter
        status = self._check(data)
        if (status is not _OK or now_ns - self._known_ns != self._usual_ns) and self._cycle_ns:
            status = self._judge(now_ns, data, status)
        if self.checker is not None:
            counter = self.checker.counter
            self.memory[COUNTER] = NO_COUNTER if counter is None else counter
            self.memory[IN_SEQUENCE] = self.checker.in_sequence
        if status is _OK or status is _OK_SOME_LOST:
            self._intake.keep(now_ns, self.index, data)
        elif status is not _REPEATED or self._known_ns != now_ns or data != self._known:
            self.valid_in_row = 0
            self.bad_in_row += 1

    def finish(self, now_ns: int) -> None:
        """Say whether all is well, after the last frame of a tick in which `accept` was asked."""
        self.memory[WELL] = self.fresh and not self.bad_in_row and self.odd_ns != now_ns

    @property
    def _known(self) -> bytes:
        """Bytes of the last frame that belongs to the stream."""
        return _bytes(self.memory[KNOWN])[: self.spec.length]

    def _remember(self, now_ns: int, data: bytes) -> None:
        self._known_ns = now_ns
        self.memory[KNOWN] = int.from_bytes(data, "little", signed=len(data) == PAYLOAD)

    def _judge(self, now_ns: int, data: bytes, status: Status) -> Status:
        """Hold a frame against the time, where its check or its time is not the usual.

        One sender's counter advances by one a cycle. Frames may be lost, late (then several come at once) or cease for
        any time; a counter that leaps without time for the frames between, or goes back, is not that sender's. Such
        frames are refused until the counter fits the time again (by a cycle; of the last frame, or of the last long run
        of frames, as one of the others may fit by chance), until `SILENT_CYCLES` without any frame, or until the new
        counter has lived alone for `ADOPTED_CYCLES`.
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
            fits = self._due(now_ns, counter, self._known_ns, known)
            fits = fits or self._due(now_ns, counter, self._steady_ns, self._steady_counter)
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
            self._remember(now_ns, data)
            return status
        silent_ns = now_ns - max(self._known_ns, self._stray_ns)
        if silent_ns >= SILENT_CYCLES * cycle_ns or self._adopted(now_ns, counter):
            return self._begin(now_ns, data, _WRONG_SEQUENCE)
        self._note(now_ns, foreign=1)
        if self.valid_in_row >= COUNTER_MODULUS:
            self._steady_ns, self._steady_counter = self._known_ns, known
        assert self.checker is not None
        self.checker.counter = known  # it goes on from the frames that are believed
        self.checker.lost -= step - 1
        self._usual_ns = -1
        return _WRONG_SEQUENCE

    def _due(self, now_ns: int, counter: int, from_ns: int, from_counter: int) -> bool:
        """Whether a counter is the one due, by a cycle, of a stream that had another one earlier."""
        cycle_ns = self._cycle_ns
        gap_ns = now_ns - from_ns - (counter - from_counter) * cycle_ns + cycle_ns
        return from_ns >= 0 and gap_ns % (COUNTER_MODULUS * cycle_ns) <= 2 * cycle_ns

    def _begin(self, now_ns: int, data: bytes, status: Status) -> Status:
        """Follow a stream from this frame on."""
        self._ahead_ns, self._judged_ns, self._steady_ns = _QUEUE_NS, now_ns, -1
        self._usual_ns = self._cycle_ns
        self._remember(now_ns, data)
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


def _bytes(word: int) -> bytes:
    return word.to_bytes(PAYLOAD, "little", signed=True)

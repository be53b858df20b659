"""End-to-end protection checked over recorded frames, in columns and chunk after chunk."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cache

import numpy as np
import numpy.typing as npt

from dbc import e2e
from dbc.database import Message
from dbc.frame import BusName
from hil.log.frames import FrameFlag, Recording

Bytes = npt.NDArray[np.uint8]

_MOST_LOST = 2  # in a row before a receiver takes a frame for out of sequence, as of `dbc.e2e.Checker`
LEGACY_SHARE = 0.9
"""From this share of legacy check values on, a message counts as recorded with them."""


@dataclass(frozen=True, slots=True)
class Integrity:
    """How a protected message came through.

    Attributes
    ----------
    received : frames in the recording.
    corrupt : of them with a wrong check value, length or counter 15; they are not used below.
    repeated : with the counter of the one before.
    lost : missing by the counters; a multiple of 15 in a row cannot be seen.
    legacy : of the corrupt ones, those that are sound by the legacy check value (`dbc.e2e`).
    """

    received: int
    corrupt: int
    repeated: int
    lost: int
    legacy: int = 0

    @property
    def is_legacy(self) -> bool:
        """Nearly every frame carries the legacy check value: an older recording, not a damaged one."""
        return self.received > 0 and self.legacy >= LEGACY_SHARE * self.received

    def __add__(self, other: "Integrity") -> "Integrity":
        return Integrity(
            self.received + other.received,
            self.corrupt + other.corrupt,
            self.repeated + other.repeated,
            self.lost + other.lost,
            self.legacy + other.legacy,
        )


class IntegrityCounter:
    """Checks one protected message (AUTOSAR profile 1A, see `dbc.e2e`) chunk after chunk.

    Parameters
    ----------
    data_id : 16-bit data id of the message.
    length : payload length, bytes, 2 to 64.
    legacy : check by the legacy value instead.

    Raises
    ------
    ValueError : a data id or a length that no such message has.
    """

    def __init__(self, data_id: int, length: int, legacy: bool = False) -> None:
        if not (0 <= data_id <= 0xFFFF and 2 <= length <= 64):
            raise ValueError(f"expected a data id 0..65535 and a length of 2..64 bytes, got {data_id} and {length}")
        self.length = length
        self.legacy = legacy
        self._start = e2e.check_value(data_id, bytes(length))  # what an all-zero payload has: the CRC is linear
        self._received = self._corrupt = self._repeated = self._lost = self._legacy = 0
        self._counter: int | None = None

    def add(self, data: Bytes, length: Bytes) -> None:
        """Check further frames of the message, in the order of the log.

        Parameters
        ----------
        data : uint8 (n, width), payloads; what lies behind ``length`` is not looked at.
        length : uint8 (n,), data bytes of each.
        """
        n = len(data)
        self._received += n
        if data.shape[1] < self.length:  # too narrow for any frame of the right length
            self._corrupt += n
            return
        difference = self._difference(data)
        counter = (data[:, 1] & 0x0F).astype(np.int8)
        formal = (length == self.length) & (counter < e2e.COUNTER_MODULUS)
        legacy = e2e.legacy_difference(self.length)
        usable = counter[formal & (difference == (legacy if self.legacy else 0))]
        self._corrupt += n - len(usable)
        if len(usable) < n and not self.legacy:
            self._legacy += int(np.count_nonzero(formal & (difference == legacy)))
        if not len(usable):
            return
        before = usable[0] if self._counter is None else np.int8(self._counter)
        steps = np.diff(usable, prepend=before) % e2e.COUNTER_MODULUS
        first = int(self._counter is None)  # the very first has none before it
        self._counter = int(usable[-1])
        repeated = int(np.count_nonzero(steps == 0))
        self._repeated += repeated - first
        self._lost += int(steps.sum(dtype=np.int64)) - (len(steps) - repeated)

    @property
    def result(self) -> Integrity:
        """What was found in all frames so far."""
        return Integrity(self._received, self._corrupt, self._repeated, self._lost, self._legacy)

    def _difference(self, data: Bytes) -> Bytes:
        """Check value on the wire XOR the profile's, uint8 (n,)."""
        if data.shape[1] % 2 or data.strides[1] != 1:
            data = np.ascontiguousarray(np.pad(data, ((0, 0), (0, data.shape[1] % 2))))
        words = data.view("<u2")
        difference = _pair(self.length - 1, True).take(words[:, 0])
        for column in range(1, (self.length + 1) // 2):
            difference ^= _pair(self.length - 1 - 2 * column, False).take(words[:, column])
        difference ^= np.uint8(self._start)
        return difference


@cache
def _alone(following: int) -> Bytes:
    """What a byte adds to the check value when ``following`` bytes come after it (-1: it is behind the payload).

    The CRC of a payload is the XOR of what each of its bytes alone gives.
    """
    if following < 0:
        return np.zeros(256, np.uint8)
    crc = np.array(e2e.CRC_TABLE, np.uint8)
    return crc if following == 0 else crc[_alone(following - 1)]


@cache
def _pair(following: int, first: bool) -> Bytes:
    """What two bytes (low, high) add, uint8 (65536,); ``following`` bytes come after the low one.

    The low byte of the ``first`` pair is the check value itself.
    """
    low = np.arange(256, dtype=np.uint8) if first else _alone(following)
    return (low[np.newaxis, :] ^ _alone(following - 1)[:, np.newaxis]).ravel()


class FrameUse(IntEnum):
    """What a receiver does with one frame of a protected message (`dbc.e2e.Checker`)."""

    USED = 0
    CORRUPT = 1  # wrong check value, length or counter 15
    REPEATED = 2  # with the counter of the one before
    OUT_OF_SEQUENCE = 3  # more than two frames missing before it without a gap in time: another sender's


def use_of_frames(
    data: Bytes, length: Bytes, time_ns: npt.NDArray[np.int64], data_id: int, message_length: int, gap_ns: int
) -> Bytes:
    """Tell of each frame of one message whether a receiver uses it: `FrameUse`, uint8 (n,).

    Unlike a receiver it takes the first sound frame, and the first one after a gap: nothing contradicts these. Where
    nearly all frames carry the legacy check value, that one counts.

    Parameters
    ----------
    data, length, data_id, message_length : as of `IntegrityCounter`.
    time_ns : int64 (n,), stamps.
    gap_ns : time without a sound frame after which a sequence may begin anew, ns.
    """
    use = np.full(len(data), FrameUse.CORRUPT, np.uint8)
    counter = IntegrityCounter(data_id, message_length)
    counter.add(data, length)
    if counter.result.received == counter.result.corrupt and not counter.result.is_legacy:
        return use
    difference = counter._difference(data)
    wanted = e2e.legacy_difference(message_length) if counter.result.is_legacy else 0
    count = (data[:, 1] & 0x0F).astype(np.int8)
    sound = np.flatnonzero((length == message_length) & (count < e2e.COUNTER_MODULUS) & (difference == wanted))
    steps = np.diff(count[sound]) % e2e.COUNTER_MODULUS
    in_sequence = ((steps > 0) & (steps <= _MOST_LOST + 1)) | (np.diff(time_ns[sound]) >= gap_ns)
    use[sound[:1]] = FrameUse.USED
    use[sound[1:]] = np.where(
        in_sequence, FrameUse.USED, np.where(steps == 0, FrameUse.REPEATED, FrameUse.OUT_OF_SEQUENCE)
    )
    return use


def check_frames(data: Bytes, length: Bytes, data_id: int, message_length: int, legacy: bool = False) -> Integrity:
    """Check all frames of one message at once; see `IntegrityCounter` for the parameters."""
    counter = IntegrityCounter(data_id, message_length, legacy)
    counter.add(data, length)
    return counter.result


def has_profile_layout(message: Message) -> bool:
    """Tell whether check value and counter of a message lie where profile 1A has them.

    The check value is the signal CRC in the first byte, the counter ALIVE_COUNTER in the low nibble of the second; the
    data id is the DBC's attribute E2EDataID, which the signals do not show.
    """
    from dbc.codec import COUNTER_SIGNAL, CRC_SIGNAL  # loads cantools, which few logs need

    masks = {signal.name: signal.mask() for signal in message.signals if signal.name in (CRC_SIGNAL, COUNTER_SIGNAL)}
    return 2 <= message.length <= 64 and masks == {CRC_SIGNAL: 0x00FF, COUNTER_SIGNAL: 0x0F00}


def check_integrity(recording: Recording, legacy: bool = False) -> dict[str, Integrity]:
    """Check every protected message of our two databases that the recording holds, as `dbc.e2e.Checker` does.

    The channel named "bench" has the messages of bench.dbc, every other one those of brake.dbc; the results of a
    message that came on several channels are added up. ``legacy`` checks by the legacy check value, which an older
    recording has (`Integrity.is_legacy`).
    """
    from dbc.contract import contract

    frames = recording.frames
    plain = (frames.flags & (FrameFlag.REMOTE | FrameFlag.ERROR) == 0) & ~frames.extended
    found: dict[str, Integrity] = {}
    for number, channel in enumerate(frames.channels):
        on_channel = np.flatnonzero(plain & (frames.channel == number))
        ids = frames.can_id[on_channel]
        for spec in contract(BusName.BENCH if channel == BusName.BENCH.value else BusName.VEHICLE).by_id.values():
            rows = on_channel[ids == spec.can_id]
            if spec.data_id is not None and len(rows):
                one = check_frames(frames.data[rows], frames.length[rows], spec.data_id, spec.length, legacy)
                found[spec.name] = found.get(spec.name, Integrity(0, 0, 0, 0)) + one
    return found

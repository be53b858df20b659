"""What the summary of a log keeps while it reads: plain arrays that the compiled pass and numpy write alike."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from hil.log.frames import FD_CODES

MAX_IDS = 4096  # identifiers with statistics of their own; the frames of all others are counted together
HASH_SIZE = 16_384  # a power of two, well above MAX_IDS
LEAST_NS, MOST_NS = 1_000, 1_000_000_000_000  # of an interval that has a bin of its own
_MANTISSA_BITS = 7  # 128 bins an octave: 0.4 to 0.8 % wide
SHIFT = 52 - _MANTISSA_BITS

Ints = npt.NDArray[np.int64]


def _place(value: float) -> int:
    return int(np.array(value).view(np.int64)) >> SHIFT


FIRST_PLACE = _place(float(LEAST_NS))
BINS = _place(float(MOST_NS)) - FIRST_PLACE + 1

CODES = np.zeros(256, np.int64)
"""Length code of a number of data bytes."""
for _code, _length in enumerate(FD_CODES):
    CODES[_length] = _code


class Id(IntEnum):
    """Columns of `State.ids`."""

    COUNT = 0
    FIRST = 1
    LAST = 2
    DATA = 3  # data frames; the columns up to MAX_AT are of those
    PREVIOUS = 4  # stamp
    INTERVALS = 5
    SUM = 6
    MIN = 7
    MAX = 8
    MAX_AT = 9  # stamp at which the longest interval began
    BACK = 10
    BACK_FRAME = 11  # of the whole log, from 1
    BACK_NS = 12
    LENGTH = 13  # of the data frame before
    LENGTH_CHANGES = 14
    LENGTHS = 15  # bit by length code
    REMOTE = 16
    FD = 17
    SENT = 18


class Channel(IntEnum):
    """Columns of `State.channels`."""

    FRAMES = 0
    ERRORS = 1
    REMOTE = 2
    FD = 3
    SWITCHED = 4
    SENT = 5
    LEAST = 6
    GREATEST = 7
    BUSY = 8  # ps
    SECOND = 9  # that is being counted, since the log's first stamp
    SECOND_BUSY = 10
    WORST = 11
    WORST_BUSY = 12


class Whole(IntEnum):
    """Places of `State.whole`."""

    FRAMES = 0
    PREVIOUS = 1
    BACK = 2
    BACK_FRAME = 3
    BACK_NS = 4
    BACK_FROM = 5
    OTHER = 6  # frames of identifiers beyond MAX_IDS
    IDS = 7
    FIRST = 8
    LEAST = 9
    GREATEST = 10


def _matrix(rows: int, columns: int) -> Ints:
    return np.zeros((rows, columns), np.int64)


@dataclass(slots=True)
class State:
    """Counts so far.

    Attributes
    ----------
    whole : int64, see `Whole`.
    ids : int64 (MAX_IDS, columns of `Id`), in the order of first appearance.
    keys : int64 (MAX_IDS,), channel << 32 | extended << 31 | identifier.
    places : int32 (HASH_SIZE,), row in ``ids`` + 1 by hashed key, 0 where there is none.
    intervals : uint32 (MAX_IDS, BINS), histograms of the time between data frames, logarithmic.
    channels : int64 (n, columns of `Channel`).
    bit_ps : int64 (n, 2), ps of a bit of each channel at its bit rate and its data bit rate.
    """

    whole: Ints = field(default_factory=lambda: np.zeros(len(Whole), np.int64))
    ids: Ints = field(default_factory=lambda: _matrix(MAX_IDS, len(Id)))
    keys: Ints = field(default_factory=lambda: np.zeros(MAX_IDS, np.int64))
    places: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros(HASH_SIZE, np.int32))
    # zeros are not held in memory before they are written: a log of few identifiers takes few pages of this
    intervals: npt.NDArray[np.uint32] = field(default_factory=lambda: np.zeros((MAX_IDS, BINS), np.uint32))
    channels: Ints = field(default_factory=lambda: _matrix(0, len(Channel)))
    bit_ps: Ints = field(default_factory=lambda: _matrix(0, 2))


def bins_of(interval_ns: Ints) -> Ints:
    """Bin of each interval (not negative)."""
    bounded = np.clip(interval_ns, LEAST_NS, MOST_NS).astype(np.float64)
    return (bounded.view(np.int64) >> SHIFT) - FIRST_PLACE


def bin_edges() -> npt.NDArray[np.float64]:
    """Lower edge of every bin, and the upper one of the last, ns."""
    return ((np.arange(BINS + 1, dtype=np.int64) + FIRST_PLACE) << SHIFT).view(np.float64)

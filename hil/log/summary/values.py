"""What the summary of a log says of its identifiers and channels."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cycle:
    """Time between the data frames of one identifier, ns.

    Attributes
    ----------
    nominal_ns : what the database states, None where it states none.
    p50_ns, p99_ns : half and 99 of 100 intervals are at most this long, within 0.8 %: the roundest number near.
    gaps : intervals longer than 2.5 nominal cycles, or else 2.5 medians; None where the frames do not come cyclically.
    max_at_ns : stamp at which the longest interval begins.
    """

    nominal_ns: int | None
    min_ns: int
    p50_ns: float
    p99_ns: float
    max_ns: int
    mean_ns: float
    gaps: int | None
    max_at_ns: int


@dataclass(frozen=True, slots=True)
class Backwards:
    """Stamps that lie before the one before them.

    Attributes
    ----------
    count : how many.
    frame : number of the first such frame in the log, from 1.
    time_ns : its stamp.
    line : its line in a text log, from 1; None where it was not looked for, and in logs without lines.
    """

    count: int
    frame: int
    time_ns: int
    line: int | None = None


@dataclass(frozen=True, slots=True)
class IdSummary:
    """One identifier on one channel.

    Attributes
    ----------
    count : frames, remote ones among them.
    cycle : None for fewer than two data frames.
    lengths : data bytes that its data frames have; ``length_changes`` times another than the frame before.
    backwards : stamps running back among its own frames.
    remote, fd, sent : remote frames, CAN FD frames, frames sent by the recorder itself.
    """

    channel: str
    can_id: int
    extended: bool
    count: int
    first_ns: int
    last_ns: int
    cycle: Cycle | None
    lengths: tuple[int, ...]
    length_changes: int
    backwards: Backwards | None
    remote: int
    fd: int
    sent: int

    @property
    def name(self) -> str:
        """Identifier as it is written: 0x123, or 0x00000123 with 29 bits."""
        return f"{self.can_id:#010x}" if self.extended else f"{self.can_id:#05x}"


@dataclass(frozen=True, slots=True)
class ChannelSummary:
    """One channel.

    Attributes
    ----------
    first_ns, last_ns : least and greatest stamp.
    errors, remote, fd, sent : frames of that kind.
    bit_rate, data_bit_rate : bit/s, as given; None where unknown.
    load, worst_load : share of the time that the bus was busy, over all and in the worst second; every frame with all
        stuff bits it may need. None where the bit rate (or the data bit rate of CAN FD frames that switch to it) is
        unknown, and for logs too short to tell.
    bits_per_s, worst_bits_per_s : the same as bits, where ``load`` is None.
    worst_at_ns : where the worst second begins.
    """

    name: str
    frames: int
    first_ns: int
    last_ns: int
    errors: int
    remote: int
    fd: int
    sent: int
    bit_rate: int | None
    data_bit_rate: int | None
    load: float | None
    worst_load: float | None
    bits_per_s: float | None
    worst_bits_per_s: float | None
    worst_at_ns: int

    @property
    def duration_s(self) -> float:
        """Time between the least and the greatest stamp, s."""
        return (self.last_ns - self.first_ns) / 1e9


@dataclass(frozen=True, slots=True)
class Summary:
    """A whole log.

    Attributes
    ----------
    first_ns, last_ns : least and greatest stamp; 0 without a frame.
    channels, ids : sorted by channel and identifier.
    other_frames : frames of identifiers beyond the first 4,096, which have no statistics of their own.
    backwards : stamps running back, in the order of the log.
    """

    frames: int
    first_ns: int
    last_ns: int
    channels: tuple[ChannelSummary, ...]
    ids: tuple[IdSummary, ...]
    other_frames: int
    backwards: Backwards | None

    @property
    def duration_s(self) -> float:
        """Time between the least and the greatest stamp, s."""
        return (self.last_ns - self.first_ns) / 1e9

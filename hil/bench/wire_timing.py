"""Timing as it is on the wire: jitter of cyclic messages, and how soon one message follows another."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dbc.frame import Frame
from hil.errors import BrakebenchError
from hil.log.frames import FrameFlag, FrameTable
from hil.log.signals.databases import Databases
from hil.log.signals.decode import DecodedLog

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
FEWEST = 10  # frames of a message, below which its intervals tell nothing
MOVED = 0.02  # of the range of a signal in the record: beyond it a signal has moved; above the noise of sensors
FAR = 0.2  # of the range: a movement beyond it is a stimulus, where it takes no longer than SOON_S; below is a drift
SOON_S = 0.2  # a driver's foot takes that for a brake application
REST_S = 0.5  # so long a signal stands before its next movement is a stimulus
ANSWER_S = 1.0  # what comes later is no answer
_OTHERS = int(FrameFlag.ERROR | FrameFlag.REMOTE)

OWN_PAIRS = (
    ("WHEEL_SPEED_FRONT", "EHB_DEMAND_FRONT"),
    ("BRAKE_PEDAL.PEDAL_TRAVEL_1", "EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL"),
    ("EHB_DEMAND_FRONT.PRESSURE_DEMAND_FL", "EHB_PRESSURE_FRONT.PRESSURE_FL"),
)
"""What is looked at where nobody asks: through the controller, and through the brake."""


class TimingError(BrakebenchError):
    """A record that tells nothing of what was asked."""


class Spread(NamedTuple):
    """Times, ms; None where there are none."""

    n: int
    p50_ms: float | None
    p99_ms: float | None
    max_ms: float | None


class Cyclic(NamedTuple):
    """A message that comes again and again.

    Attributes
    ----------
    name, channel, frames : message (its identifier where no database has it), channel, frames seen.
    cycle_ms, stated : cycle time: of the database, or else the median interval.
    jitter : absolute difference of an interval from the cycle time.
    shortest_ms, longest_ms : intervals.
    missed : cycles without a frame, by intervals of more than one and a half cycles.
    """

    name: str
    channel: str
    frames: int
    cycle_ms: float
    stated: bool
    jitter: Spread
    shortest_ms: float
    longest_ms: float
    missed: int


class Response(NamedTuple):
    """How soon one message follows another.

    Attributes
    ----------
    stimulus, response : messages, or signals.
    age : time from the newest frame of the stimulus to each frame of the response, up to the last stimulus: what the
        answer can be based on.
    reaction : time from the frame with which a signal that stood for half a second begins to move (by 2 % of its
        range, by 20 % within 0.2 s) to the frame with which the other one has moved by 2 % of its own; None where no
        signals were named.
    unanswered : movements without an answer within a second.
    """

    stimulus: str
    response: str
    age: Spread
    reaction: Spread | None
    unanswered: int


def spread(times_ms: Floats) -> Spread:
    """Median, 99th percentile and maximum."""
    if not len(times_ms):
        return Spread(0, None, None, None)
    p50, p99, most = (round(float(v), 4) for v in np.percentile(times_ms, (50, 99, 100)))
    return Spread(len(times_ms), p50, p99, most)


def table_of(heard: Sequence[Frame]) -> FrameTable:
    """Frames of live buses as a table; the channels are the names of the buses."""
    channels = tuple(dict.fromkeys(str(frame.bus) for frame in heard))
    data = b"".join(frame.data.ljust(8, b"\0") for frame in heard)
    return FrameTable(
        channels,
        np.array([frame.time_ns for frame in heard], np.int64),
        np.array([channels.index(str(frame.bus)) for frame in heard], np.int32),
        np.array([frame.can_id for frame in heard], np.uint32),
        np.array([frame.extended for frame in heard], np.bool_),
        np.array([len(frame.data) for frame in heard], np.uint8),
        np.frombuffer(data, np.uint8).reshape(-1, 8),
        np.zeros(len(heard), np.uint8),
    )


def cyclic_messages(frames: FrameTable, databases: Databases) -> list[Cyclic]:
    """Every message of a record that has a cycle, by channel and identifier; those sent on a change are left out."""
    key = frames.channel.astype(np.int64) << 30 | frames.extended.astype(np.int64) << 29 | frames.can_id
    data_frames = (frames.flags & _OTHERS) == 0
    states_cycles = databases.states_cycles
    found = []
    for code in np.unique(key[data_frames]).tolist():
        time_ns = np.sort(frames.time_ns[data_frames & (key == code)])
        if len(time_ns) < FEWEST:
            continue
        channel, extended, can_id = frames.channels[code >> 30], bool(code >> 29 & 1), code & 0x1FFFFFFF
        message = databases.message(channel, can_id, extended)
        stated_ms = None if message is None else message.cycle_time_ms
        if message is not None and states_cycles and not stated_ms:
            continue
        interval_ms = np.diff(time_ns) * 1e-6
        cycle_ms = float(stated_ms or np.median(interval_ms))
        missed = np.rint(interval_ms[interval_ms > 1.5 * cycle_ms] / cycle_ms) - 1.0 if cycle_ms > 0.0 else np.empty(0)
        found.append(
            Cyclic(
                f"0x{can_id:X}" if message is None else message.name,
                channel,
                len(time_ns),
                round(cycle_ms, 4),
                bool(stated_ms),
                spread(np.abs(interval_ms - cycle_ms)),
                round(float(interval_ms.min()), 4),
                round(float(interval_ms.max()), 4),
                int(missed.sum()),
            )
        )
    return found


def response_of(frames: FrameTable, databases: Databases, stimulus: str, response: str) -> Response:
    """How soon a message or signal follows another one.

    Raises
    ------
    TimingError : one of them is not in the record; a message beside a signal.
    """
    if ("." in stimulus) != ("." in response):
        raise TimingError(f"latency: {stimulus} and {response}: expected two messages, or two signals MESSAGE.SIGNAL")
    named = {name for name in (stimulus, response) if "." in name}
    log = databases.decoder(named or {stimulus, response}).add(frames)
    came, answered = (_times(frames, log, name.partition(".")[0]) for name in (stimulus, response))
    answered = answered[answered <= came[-1]]  # behind the last stimulus nothing is an answer any more
    before = np.searchsorted(came, answered, side="right") - 1
    age: Floats = np.asarray((answered - came[np.maximum(before, 0)])[before >= 0] * 1e-6, np.float64)
    if not named:
        return Response(stimulus, response, spread(age), None, 0)
    reaction, unanswered = _reactions(*_series(frames, log, stimulus), *_series(frames, log, response))
    return Response(stimulus, response, spread(age), spread(reaction), unanswered)


def _times(frames: FrameTable, log: DecodedLog, message: str) -> Times:
    rows = log.rows.get(message)
    if rows is None or not len(rows):
        seen = ", ".join(sorted(log.rows)) or "none"
        raise TimingError(f"latency: no frame of {message} in the record; messages of the databases in it: {seen}")
    return np.sort(frames.time_ns[rows])


def _series(frames: FrameTable, log: DecodedLog, name: str) -> tuple[Times, Floats]:
    column = log.columns.get(name)
    if column is None:
        raise TimingError(f"latency: no signal {name} in the record; `brakebench decode` lists them")
    time_ns = frames.time_ns[column.rows]
    order = np.argsort(time_ns, kind="stable")
    return time_ns[order], np.asarray(column.values, np.float64)[order]


def _reactions(t_ns: Times, v: Floats, to_ns: Times, w: Floats) -> tuple[Floats, int]:
    """Times from each movement to its answer, ms, and how many movements had none."""
    times, unanswered = [], 0
    band = MOVED * float(np.ptp(w)) if len(w) else 0.0
    for moved_ns in _movements(t_ns, v):
        first = int(np.searchsorted(to_ns, moved_ns, side="right"))
        last = int(np.searchsorted(to_ns, moved_ns + round(ANSWER_S * 1e9), side="right"))
        if first == 0 or last == len(to_ns):  # the record holds but a part of it
            continue
        moved = np.flatnonzero(np.abs(w[first:last] - w[first - 1]) > band)
        if band > 0.0 and len(moved):
            times.append(float(to_ns[first + moved[0]] - moved_ns) * 1e-6)
        else:
            unanswered += 1
    return np.array(times), unanswered


def _movements(t_ns: Times, v: Floats) -> list[int]:
    """When a signal that stood begins to move, and soon has gone far: a drift is no stimulus."""
    found: list[int] = []
    reach = float(np.ptp(v)) if len(v) else 0.0
    stands_ns, at = None, 0.0
    for k, (now_ns, value) in enumerate(zip(t_ns.tolist(), v.tolist(), strict=True)):
        if stands_ns is None or abs(value - at) > MOVED * reach:
            if stands_ns is not None and now_ns - stands_ns >= REST_S * 1e9:
                soon = v[k : int(np.searchsorted(t_ns, now_ns + round(SOON_S * 1e9), side="right"))]
                if float(np.abs(soon - at).max()) > FAR * reach:
                    found.append(now_ns)
            stands_ns, at = now_ns, value
    return found

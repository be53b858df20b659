"""What one run gave, measured on its recording."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dbc.bench_messages import ManoeuvreState
from dbc.codec import COUNTER_SIGNAL, CRC_SIGNAL
from dbc.contract import MessageSpec, contract
from dbc.frame import BusName, LinkEvent
from hil.braking import LOWER, UPPER, crossings, mean_fully_developed_deceleration
from hil.bus.error_frame import events_of
from hil.errors import BrakebenchError
from hil.log.frames import FrameFlag, Recording
from hil.log.read import read_log
from hil.log.signals.decode import DecodedLog, decode_log, own_databases
from hil.log.signals.integrity import FrameUse, use_of_frames

Floats = NDArray[np.float64]

STANDSTILL_MPS = 0.05
PEDAL_ON = 0.005  # of the travel: above the noise of the sensor, below any brake demand
_SPECS = {spec.name: spec for bus in BusName for spec in contract(bus).by_id.values()}
_SI = {f"{spec.name}.{field.signal}": field.si_per_unit for spec in _SPECS.values() for field in spec.fields} | {
    f"{spec.name}.{signal}": 1.0
    for spec in _SPECS.values()
    if spec.data_id is not None
    for signal in (CRC_SIGNAL, COUNTER_SIGNAL)
}
_WRONG_LENGTH = "wrong length"
_WHY = {FrameUse.CORRUPT: "corrupt", FrameUse.REPEATED: "repeated", FrameUse.OUT_OF_SEQUENCE: "out of sequence"}


MEASURED = (
    "stop_distance_m", "stop_time_s", "mean_decel_mps2", "mfdd_mps2", "demanded_decel_mps2", "energy_recuperated_j",
    "frames_sent", "frames_lost", "frames_corrupt", "bus_load",
)  # fmt: skip
"""Numbers of `RunResult` that a run in virtual time has."""


class UnknownSignalError(BrakebenchError, LookupError):
    """A name that neither of our two databases has."""


class Signals:
    """SI series of a recording of our own buses, on a time axis that starts with the manoeuvre.

    Only frames that a receiver uses are in the series (`hil.log.signals.integrity.FrameUse`); of messages without
    protection those of the right length. The others are counted in `unused`.

    Parameters
    ----------
    log : the recording, or the path of its file.

    Attributes
    ----------
    decoded : the log with its account of every frame.
    start_s : log time of the start of the manoeuvre (of the log where there is none).
    """

    def __init__(self, log: Path | Recording) -> None:
        recording = read_log(log) if isinstance(log, Path) else log
        self.decoded: DecodedLog = decode_log(recording, own_databases())
        self._use: dict[str, NDArray[np.uint8]] = {}
        self.start_s = float(self.decoded.time_s[0]) if len(self.decoded.time_s) else 0.0
        t_s, state = self.get("TRUTH_MOTION.MANOEUVRE")
        running = t_s[(state == ManoeuvreState.RUNNING) | (state == ManoeuvreState.FINISHED)]
        if len(running):
            self.start_s += float(running[0])

    def get(self, name: str) -> tuple[Floats, Floats]:
        """Time since the start of the manoeuvre, s, and value, SI, of ``MESSAGE.SIGNAL``; empty where never received.

        Raises
        ------
        UnknownSignalError : no message of ours has such a signal.
        """
        if name not in _SI:
            raise UnknownSignalError(f"no signal {name!r} in our databases; {nearest(name, _SI)}")
        column = self.decoded.columns.get(name)
        if column is None:
            return np.empty(0), np.empty(0)
        message = name.partition(".")[0]
        used = self._used(message)[np.searchsorted(self.decoded.rows[message], column.rows)] == FrameUse.USED
        t_s, values = self.decoded.time_s[column.rows[used]], column.values[used]
        order = np.argsort(t_s, kind="stable")
        return t_s[order] - self.start_s, np.asarray(values, np.float64)[order] * _SI[name]

    @property
    def unused(self) -> dict[str, dict[str, int]]:
        """Frames that no receiver uses, by message and reason; messages without one are left out."""
        found = {name: self._reasons(name) for name in self.decoded.rows}
        return {name: reasons for name, reasons in found.items() if reasons}

    def _reasons(self, message: str) -> dict[str, int]:
        counts = np.bincount(self._used(message), minlength=len(FrameUse)).tolist()
        if _SPECS[message].data_id is None:
            return {_WRONG_LENGTH: counts[FrameUse.CORRUPT]} if counts[FrameUse.CORRUPT] else {}
        return {why: counts[use] for use, why in _WHY.items() if counts[use]}

    def _used(self, message: str) -> NDArray[np.uint8]:
        """`FrameUse` of every frame of a message."""
        if message not in self._use:
            rows = self.decoded.rows[message]
            self._use[message] = _use_of(_SPECS[message], self.decoded.recording, rows)
        return self._use[message]


def _use_of(spec: MessageSpec, recording: Recording, rows: NDArray[np.int64]) -> NDArray[np.uint8]:
    frames = recording.frames
    data, length = frames.data[rows], frames.length[rows]
    if spec.data_id is not None:
        gap_ns = 3 * spec.cycle_ns  # a shorter gap leaves the sequence as it is; a command, without a cycle, has none
        return use_of_frames(data, length, frames.time_ns[rows], spec.data_id, spec.length, gap_ns)
    return np.where(length == spec.length, FrameUse.USED, FrameUse.CORRUPT).astype(np.uint8)


def nearest(name: str, known: Iterable[str]) -> str:
    """What somebody who wrote ``name`` may have meant, as a clause of an error."""
    names = {one.upper(): one for one in known}
    found = [names[one] for one in get_close_matches(name.upper(), names, n=3, cutoff=0.5)]
    return f"did you mean {' or '.join(found)}?" if found else "they are listed in dbc/brake.dbc and dbc/bench.dbc"


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late the ticks of a node woke, ms."""

    p50: float
    p99: float
    max: float


@dataclass(frozen=True, slots=True)
class RunResult:
    """The numbers of a run; the keys of ``run --json``.

    Attributes
    ----------
    stop_distance_m, stop_time_s : from the pedal's first movement to standstill; None without a complete stop.
    mean_decel_mps2 : mean deceleration over that time; positive.
    mfdd_mps2 : mean fully developed deceleration, from 0.8 to 0.1 of the speed at the pedal's first movement.
    demanded_decel_mps2 : mean of what the driver demanded over that time.
    energy_recuperated_j : electrical energy returned to the battery over that time.
    frames_sent : frames recorded on the vehicle bus.
    frames_lost, frames_corrupt : as ECU and plant saw them by counter and check value.
    overruns, lateness_ms : of the manoeuvre: ticks that both nodes skipped; how late ticks woke, of the worse node.
    bus_load : mean share of the vehicle bus's bit rate in the manoeuvre, each frame with all stuff bits it may need.
    link_states : number of link events by name.
    """

    stop_distance_m: float | None
    stop_time_s: float | None
    mean_decel_mps2: float | None
    mfdd_mps2: float | None
    demanded_decel_mps2: float | None
    energy_recuperated_j: float | None
    frames_sent: int
    frames_lost: int
    frames_corrupt: int
    overruns: int
    lateness_ms: Lateness
    bus_load: float
    link_states: dict[str, int]

    def as_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)


def measure(signals: Signals, bit_rate: int | None = None) -> RunResult:
    """Measure a recorded run; ``bit_rate`` of the vehicle bus where it is not the one that its database states."""
    braking = _braking_window(signals)
    distance = time = mean = developed = demanded = energy = None
    if braking is not None:
        start_s, end_s = braking
        time = end_s - start_s
        distance = _rise(signals, "TRUTH_MOTION.DISTANCE", start_s, end_s)
        mean = float(np.interp(start_s, *signals.get("TRUTH_MOTION.SPEED"))) / time
        developed = _fully_developed(signals, start_s)
        energy = _rise(signals, "TRUTH_ENERGY.RECUPERATED", start_s, end_s)
        t_s, values = signals.get("BRAKE_STATUS.DEMANDED_DECELERATION")
        inside = values[(t_s >= start_s) & (t_s <= end_s)]
        demanded = float(inside.mean()) if len(inside) else None
    nodes = ("ECU", "PLANT")
    return RunResult(
        stop_distance_m=distance,
        stop_time_s=time,
        mean_decel_mps2=mean,
        mfdd_mps2=developed,
        demanded_decel_mps2=demanded,
        energy_recuperated_j=energy,
        frames_sent=_vehicle_frames(signals).size,
        frames_lost=sum(_last(signals, f"{node}_RECEPTION.FRAMES_LOST") for node in nodes),
        frames_corrupt=sum(_last(signals, f"{node}_RECEPTION.FRAMES_CORRUPT") for node in nodes),
        overruns=sum(_overruns(signals, node) for node in nodes),
        lateness_ms=max((_lateness(signals, node) for node in nodes), key=lambda lateness: lateness.p99),
        bus_load=_bus_load(signals, bit_rate or contract(BusName.VEHICLE).bit_rate),
        link_states=dict(Counter(event.state.value for event in link_events(signals))),
    )


def _braking_window(signals: Signals) -> tuple[float, float] | None:
    """First pedal movement of the manoeuvre to standstill; None without both."""
    t_pedal, pedal = signals.get("BRAKE_PEDAL.PEDAL_TRAVEL_1")
    pressed = t_pedal[(pedal > PEDAL_ON) & (t_pedal >= 0.0)]
    t_s, speed = signals.get("TRUTH_MOTION.SPEED")
    if not len(pressed):
        return None
    still = t_s[(np.abs(speed) < STANDSTILL_MPS) & (t_s > pressed[0])]
    return (float(pressed[0]), float(still[0])) if len(still) else None


def _fully_developed(signals: Signals, start_s: float) -> float | None:
    """Mean fully developed deceleration of a stop; None where a plant of somebody's own does not send the distance."""
    t_s, speed = signals.get("TRUTH_MOTION.SPEED")
    v0 = float(np.interp(start_s, t_s, speed))
    times = crossings(t_s, speed, start_s, (UPPER * v0, LOWER * v0))
    if times is None or v0 < STANDSTILL_MPS:
        return None
    ways = [_rise(signals, "TRUTH_MOTION.DISTANCE", start_s, end_s) for end_s in times]
    if ways[0] is None or ways[1] is None or ways[1] <= ways[0]:
        return None
    return mean_fully_developed_deceleration(v0, ways[0], ways[1])


def _rise(signals: Signals, name: str, start_s: float, end_s: float) -> float | None:
    """By how much a signal grew; None where a plant of somebody's own does not send it."""
    t_s, values = signals.get(name)
    return float(np.interp(end_s, t_s, values) - np.interp(start_s, t_s, values)) if len(t_s) else None


def _last(signals: Signals, name: str) -> int:
    _, values = signals.get(name)
    return int(values[-1]) if len(values) else 0


def _overruns(signals: Signals, node: str) -> int:
    t_s, count = signals.get(f"{node}_TIMING.OVERRUNS")
    count = count[t_s >= 0.0]
    return max(0, int(count[-1] - count[0])) if len(count) else 0


def _lateness(signals: Signals, node: str) -> Lateness:
    t_s, late_s = signals.get(f"{node}_TIMING.LATENESS")
    late_s = late_s[t_s >= 0.0]
    if not len(late_s):
        return Lateness(0.0, 0.0, 0.0)
    p50, p99 = np.percentile(late_s, (50, 99))
    return Lateness(*(round(float(v) * 1e3, 3) for v in (p50, p99, late_s.max())))


def _vehicle_frames(signals: Signals) -> NDArray[np.intp]:
    frames = signals.decoded.recording.frames
    if BusName.VEHICLE.value not in frames.channels:
        return np.empty(0, np.intp)
    ours = frames.channel == frames.channels.index(BusName.VEHICLE.value)
    return np.flatnonzero(ours & ((frames.flags & FrameFlag.ERROR) == 0))


def _bus_load(signals: Signals, bit_rate: int) -> float:
    """Share of the bit rate; a stuffed 11-bit frame takes 47 + 8 n + floor((34 + 8 n - 1) / 4) bits (Tindell 1994)."""
    frames, rows = signals.decoded.recording.frames, _vehicle_frames(signals)
    rows = rows[signals.decoded.time_s[rows] >= signals.start_s]
    if rows.size < 2:
        return 0.0
    payload_bits = 8 * frames.length[rows].astype(np.int64)
    bits = int((47 + payload_bits + (33 + payload_bits) // 4).sum())
    t_s = signals.decoded.time_s[rows]
    span_s = float(t_s.max() - t_s.min())  # 0 where a run ended in its first tick
    return bits / (bit_rate * span_s) if span_s > 0.0 else 0.0


def link_events(signals: Signals) -> list[LinkEvent]:
    """Link events on record; ``time_ns`` counts from the start of the manoeuvre."""
    frames = signals.decoded.recording.frames
    events: list[LinkEvent] = []
    for row in np.flatnonzero((frames.flags & FrameFlag.ERROR) != 0):
        bus = BusName(frames.channels[frames.channel[row]])
        time_ns = round((float(signals.decoded.time_s[row]) - signals.start_s) * 1e9)
        events += events_of(int(frames.can_id[row]), frames.data[row].tobytes(), bus, time_ns)
    return events

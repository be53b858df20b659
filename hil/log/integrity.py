"""End-to-end protection checked over a whole recording of our own messages."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dbc import e2e
from dbc.contract import MessageSpec, contract
from dbc.frame import BusName
from hil.log.frames import FrameFlag, FrameTable, Recording

_CRC = np.array([e2e.crc8(bytes([value]), 0) ^ 0xFF for value in range(256)], np.uint8)


@dataclass(frozen=True, slots=True)
class Integrity:
    """How a protected message came through.

    Attributes
    ----------
    received : frames in the recording.
    corrupt : of them with a wrong check value, length or counter 15; they are not used below.
    repeated : with the counter of the one before.
    lost : missing by the counters; a multiple of 15 in a row cannot be seen.
    """

    received: int
    corrupt: int
    repeated: int
    lost: int


def check_integrity(recording: Recording) -> dict[str, Integrity]:
    """Check every protected message of our two databases that the recording holds, as `dbc.e2e.Checker` does.

    The channel named "bench" has the messages of bench.dbc, every other one those of brake.dbc; the results of a
    message that came on several channels are added up.
    """
    frames = recording.frames
    frames = frames.take((frames.flags & (FrameFlag.REMOTE | FrameFlag.ERROR) == 0) & ~frames.extended)
    found: dict[str, Integrity] = {}
    for number, channel in enumerate(frames.channels):
        on_channel = np.flatnonzero(frames.channel == number)
        ids = frames.can_id[on_channel]
        for spec in contract(BusName.BENCH if channel == BusName.BENCH.value else BusName.VEHICLE).by_id.values():
            rows = on_channel[ids == spec.can_id]
            if spec.data_id is not None and len(rows):
                one = _check(frames, rows, spec, spec.data_id)
                before = found.get(spec.name, Integrity(0, 0, 0, 0))
                found[spec.name] = Integrity(
                    before.received + one.received,
                    before.corrupt + one.corrupt,
                    before.repeated + one.repeated,
                    before.lost + one.lost,
                )
    return found


def _check(frames: FrameTable, rows: npt.NDArray[np.int64], spec: MessageSpec, data_id: int) -> Integrity:
    payload = frames.data[rows]
    start = _CRC[_CRC[0xFF ^ (data_id & 0xFF)] ^ (data_id >> 8)]
    crc = np.full(len(rows), start, np.uint8)
    for column in range(1, spec.length):
        crc = _CRC[crc ^ payload[:, column]]
    counter = (payload[:, 1] & 0x0F).astype(np.int64)
    sound = (frames.length[rows] == spec.length) & (counter < e2e.COUNTER_MODULUS) & (payload[:, 0] == crc ^ 0xFF)
    steps = np.diff(counter[sound]) % e2e.COUNTER_MODULUS
    return Integrity(
        received=len(rows),
        corrupt=int(np.count_nonzero(~sound)),
        repeated=int(np.count_nonzero(steps == 0)),
        lost=int((steps[steps > 0] - 1).sum()),
    )

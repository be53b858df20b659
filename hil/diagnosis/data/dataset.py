"""What is replayed and compared: drives on a 10 ms grid, cut into segments."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hil.diagnosis.data.log import Floats, Log

ROW_S = 0.01
SLOW_MPS = 2.0  # below, wheel sensors and the contact's low-speed terms say little
GROUPS = ("wheel", "pressure", "motor")
SINGLES = ("ax", "ay", "yaw", "gps")


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch that is replayed freely from its start: rows of one drive, and the speed it starts with."""

    first: int
    last: int
    start_wheel_rad_s: float
    start_speed_mps: float | None


@dataclass(frozen=True, eq=False)
class Recording:
    """One log, ready for replay.

    Attributes
    ----------
    inputs : (rows, INPUT.size), rows of 10 ms.  segments : in order, without gaps.
    measured : group of tracks -> (samples, channels); NaN where nothing is known.  stride : rows a sample.
    moving, resting : (samples,) where speeds, and where the body at rest is compared.
    speed_mps, pressure_pa : (samples,) about the speed, and the largest pressure.
    state_of_charge : at the start.  number : among the drives.
    wait_s : standard deviation of what two nodes' frames wait more or less than each other.
    compared : track (`hil.diagnosis.noise.model`) -> (samples,) where the simulation follows it; all else, everywhere.
    """

    log: Log
    inputs: Floats
    segments: tuple[Segment, ...]
    measured: dict[str, Floats]
    stride: int
    moving: Floats
    resting: Floats
    speed_mps: Floats
    pressure_pa: Floats
    state_of_charge: float
    number: int = 0
    timestamp_jitter_s: float = 0.0
    compared: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Samples compared."""
        return len(self.inputs) // self.stride


@dataclass(frozen=True, eq=False)
class Dataset:
    """All drives of one diagnosis; ``followed`` are the groups whose demands the simulation follows."""

    recordings: tuple[Recording, ...]
    measured_input_mask: Floats
    groups: tuple[str, ...]
    sample_s: float
    missing_channels: tuple[str, ...]
    tracked_actuators: tuple[str, ...] = ("pressure", "motor")

    @property
    def segments(self) -> list[tuple[int, Segment]]:
        """Every segment with its drive's number."""
        return [(k, segment) for k, drive in enumerate(self.recordings) for segment in drive.segments]

    def segment_ids(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Segment number of every sample of all drives, in order."""
        numbers, parts = 0, []
        for drive in self.recordings:
            part = np.zeros(drive.samples, np.int64)
            for segment in drive.segments:
                part[segment.first // drive.stride : segment.last // drive.stride] = numbers
                numbers += 1
            parts.append(part)
        return np.concatenate(parts)

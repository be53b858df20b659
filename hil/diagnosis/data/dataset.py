"""The dataset that is simulated and compared: recordings on a 10 ms grid, cut into segments."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hil.diagnosis.data.log import Floats, Log

ROW_S = 0.01
SLOW_MPS = 2.0  # below, wheel sensors and the contact's low-speed terms dominate
GROUPS = ("wheel", "pressure", "motor")
SINGLES = ("ax", "ay", "yaw", "gps")


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch simulated open loop from its start: rows ``first`` to before ``last`` of a recording, and the measured
    wheel and ground speeds at its start."""

    first: int
    last: int
    start_wheel_rad_s: float
    start_speed_mps: float | None


@dataclass(frozen=True, eq=False)
class Recording:
    """One log, ready for simulation.

    Attributes
    ----------
    inputs : (rows, INPUT.size), rows of 10 ms.  segments : in order, without gaps.
    measured : group of tracks -> (samples, channels); NaN where nothing was measured.  stride : rows per sample.
    moving, resting : (samples,) 1 where the motion, and where the body at rest is compared, else 0.
    speed_mps, pressure_pa : (samples,) approximate speed, and largest pressure of a wheel.
    state_of_charge : at the start, 0 to 1.  number : index in the dataset.
    timestamp_jitter_s : standard deviation of the difference in delay between the frames of two nodes.
    compared : track (`hil.diagnosis.noise.model`) -> (samples,) where the simulation can follow it; others everywhere.
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
        """Number of samples."""
        return len(self.inputs) // self.stride


@dataclass(frozen=True, eq=False)
class Dataset:
    """All recordings of one diagnosis.

    Attributes
    ----------
    measured_input_mask : (CUT.size,) 1 where the simulation takes the measured value for its own.
    groups : groups of tracks to compare.  sample_s : time between two samples, s.
    missing_channels : what missing channels leave undiagnosed, for the reader.
    tracked_actuators : groups whose demands the simulation follows.
    """

    recordings: tuple[Recording, ...]
    measured_input_mask: Floats
    groups: tuple[str, ...]
    sample_s: float
    missing_channels: tuple[str, ...]
    tracked_actuators: tuple[str, ...] = ("pressure", "motor")

    @property
    def segments(self) -> list[tuple[int, Segment]]:
        """Every segment with the index of its recording."""
        return [(k, segment) for k, recording in enumerate(self.recordings) for segment in recording.segments]

    def segment_ids(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """(samples of all recordings,) running number of each sample's segment."""
        segment_id, parts = 0, []
        for recording in self.recordings:
            part = np.zeros(recording.samples, np.int64)
            for segment in recording.segments:
                part[segment.first // recording.stride : segment.last // recording.stride] = segment_id
                segment_id += 1
            parts.append(part)
        return np.concatenate(parts)

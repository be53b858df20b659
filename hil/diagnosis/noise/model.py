"""The noise model: white sensor noise and coloured disturbances of each track, and residuals whitened by it.

Takes channels of a dataset (residuals or Jacobian columns); gives them as *tracks* (wheels as mean and differences, so
that errors of tracks are independent) and as innovations, with the log-likelihood.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hil.diagnosis.data.dataset import SINGLES, Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import channel_innovations, longitudinal_innovations
from hil.diagnosis.parallel import parallel_map

Stack = Mapping[str, Floats]
REFERENCE_MPS = 20.0
"""Speed at which noise in proportion to speed is stated."""
MODES = np.array([[0.25, 0.25, 0.25, 0.25], [0.25, 0.25, -0.25, -0.25], [0.5, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]])
MODE_NAMES = ("mean", "front-rear", "left-right front", "left-right rear")
_AFTER_START_S = {"ay": 0.3, "yaw": 0.3, "gps": 0.5}
"""After the start of a segment, how long tracks are not compared: the body swings in; a ground speed that a receiver
computes in 0.1 to 0.2 s (`hil.diagnosis.vehicle.latency`) still is that of the segment before. Others: one sample."""
LONGITUDINAL = ("wheel.mean", "ax", "gps")
"""Tracks along the road, in the order of the Kalman filter."""
_WIDE = 8
"""Columns from which threads pay."""
_LEAST_SAMPLES = 50
"""Compared samples that a track needs: its noise cannot be estimated from fewer."""


@dataclass(frozen=True, eq=False)
class ChannelNoise:
    """Noise of one track: white variance a^2 + (b v / 20 m/s)^2, AR(1) of standard deviation c and time constant tau_s.

    a, b and c have the unit of the track.
    """

    a: float
    b: float
    c: float
    tau_s: float


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of all tracks.

    ``disturbances`` are (standard deviation, tau in s) of force, slope and accelerometer (m/s2), of the error all
    wheels share (m/s at 20 m/s), and of the ground speed (m/s) where one is logged; see
    `hil.diagnosis.noise.innovations`.

    ``scales`` are factors of the standard deviations, (segments,) by track; the tracks along the road share those of
    "long". Where the car is driven hard the model's own error is larger too. ``enabled`` False keeps white noise alone.
    """

    tracks: Mapping[str, ChannelNoise]
    disturbances: tuple[tuple[float, float], ...]
    enabled: bool = True
    scales: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SampleMasks:
    """Masks, starts and speeds by sample, (samples,) over all recordings; the same for every residual.

    ``log_start``, ``segment_start`` and ``moving`` are 1 where true; ``present`` by track is 1 where it is compared.
    ``jitter_variance`` by track comes of frames that wait for the bus: the squared slope times the time waited.
    """

    log_start: Floats
    segment_start: Floats
    moving: Floats
    speed_mps: Floats
    segment_id: Floats
    sample_s: float
    present: Mapping[str, Floats]
    names: tuple[str, ...]
    jitter_variance: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, case: Dataset) -> "SampleMasks":
        """Masks of a dataset."""
        log_start, segment_start = [], []
        for drive in case.recordings:
            first, later = np.zeros(drive.samples), np.zeros(drive.samples)
            first[0] = 1.0
            for segment in drive.segments[1:]:
                later[segment.first // drive.stride] = 1.0
            log_start.append(first)
            segment_start.append(later)
        tracks: dict[str, list[Floats]] = {}
        for drive in case.recordings:
            for group, values in drive.measured.items():
                for name, known in _known(group, values, drive.moving, drive.resting).items():
                    tracks.setdefault(name, []).append(known * drive.compared.get(name, 1.0))
        present = {name: np.concatenate(parts) for name, parts in tracks.items()}
        starts = np.concatenate(segment_start)  # a lag mixes the first sample with those before
        for name, known in present.items():
            samples = int(np.ceil(_AFTER_START_S.get(name, 0.0) / case.sample_s))
            known[np.convolve(starts, np.ones(max(samples, 1)))[: len(starts)] > 0.5] = 0.0
        redundant = _redundant_channels(case)
        present = {
            name: known for name, known in present.items() if known.sum() > _LEAST_SAMPLES and name not in redundant
        }
        return cls(
            np.concatenate(log_start), starts, np.concatenate([d.moving for d in case.recordings]) * 1.0,
            np.concatenate([d.speed_mps for d in case.recordings]), case.segment_ids(), case.sample_s, present,
            tuple(present), _jitter_variance(case),
        )  # fmt: skip


def _redundant_channels(case: Dataset) -> set[str]:
    """Torque tracks that repeat others where motors act on one axle alone: front less rear is the mean again."""
    torques = [np.nan_to_num(drive.measured["motor"]) for drive in case.recordings if "motor" in drive.measured]
    acts = [any(one[:, axle].any() for one in torques) for axle in (slice(0, 2), slice(2, 4))]
    if acts[0] == acts[1]:
        return set()
    return {"motor.front-rear", f"motor.left-right {'rear' if acts[0] else 'front'}"}


def _jitter_variance(case: Dataset) -> dict[str, Floats]:
    """Variance by frames that wait, (samples,) by track; none for the wheels, whose time stamps are the log's.

    At a corner the steeper side counts; rows that are averaged to a sample wait independently.
    """
    variances: dict[str, list[Floats]] = {}
    for drive in case.recordings:
        wait = drive.timestamp_jitter_s / (drive.stride**0.5 * case.sample_s)
        for group, values in drive.measured.items():
            if group in ("wheel", "gps"):
                continue
            weights = np.ones((1, 1)) if group in SINGLES else MODES.T
            names = [group] if group in SINGLES else [f"{group}.{mode}" for mode in MODE_NAMES]
            steps = wait * np.abs(np.nan_to_num(np.diff(values, axis=0)) @ weights)
            ahead, behind = np.pad(steps, ((0, 1), (0, 0))), np.pad(steps, ((1, 0), (0, 0)))
            for name, column in zip(names, (np.maximum(ahead, behind) ** 2).T, strict=True):
                variances.setdefault(name, []).append(column)
    return {name: np.concatenate(parts) for name, parts in variances.items()}


def _known(group: str, values: Floats, moving_now: Floats, resting: Floats) -> dict[str, Floats]:
    """Tracks of a group of channels (samples, channels), 1 where each is compared, else 0."""
    finite = np.isfinite(values)
    if group in SINGLES:
        known = finite[:, 0] & (moving_now + (resting if group != "gps" else 0.0) > 0.5)
        return {group: known * 1.0}
    within = (moving_now > 0.5) if group == "wheel" else np.ones(len(values), bool)
    if group == "wheel" and not finite.all(axis=1).any():
        return {"wheel.mean": (finite.any(axis=1) & within) * 1.0}
    known = finite.all(axis=1) & within
    return {f"{group}.{mode}": known * 1.0 for mode in MODE_NAMES}


def tracks_of(stack: Stack, frame: SampleMasks, radius_m: float) -> dict[str, Floats]:
    """Residuals or differences (samples, channels) by group as tracks (samples, 1); wheel speeds in m/s."""
    tracks: dict[str, Floats] = {}
    for group, values in stack.items():
        if group in SINGLES:
            tracks[group] = values
            continue
        factor = radius_m if group == "wheel" else 1.0
        if group == "wheel" and "wheel.front-rear" not in frame.names:
            tracks["wheel.mean"] = factor * np.nanmean(values, axis=1, keepdims=True)
            continue
        modes = values @ (factor * MODES.T)
        tracks |= {f"{group}.{mode}": modes[:, k : k + 1] for k, mode in enumerate(MODE_NAMES)}
    return {name: np.where(np.isnan(values), 0.0, values) for name, values in tracks.items() if name in frame.names}


def whiten(
    tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, into: Mapping[str, Floats] | None = None,
    chosen: Sequence[int] | None = None,
) -> tuple[dict[str, Floats], float]:  # fmt: skip
    """Innovations by track, (samples, columns) in the precision given, and the log-likelihood of the first column.

    They are written ``into`` arrays by track, where these are given; of some ``chosen`` columns alone only into such.
    """
    out = {name: np.empty(one.shape, one.dtype) for name, one in tracks.items()} if into is None else dict(into)
    filters: list[Callable[[], float]] = [
        partial(_whiten_channel, name, values, frame, noise, out[name], chosen)
        for name, values in tracks.items()
        if name not in LONGITUDINAL
    ]
    if any(name in tracks for name in LONGITUDINAL):
        filters.insert(0, partial(_whiten_longitudinal, tracks, frame, noise, out, chosen))
    wide = max((values.shape[1] for values in tracks.values()), default=0) >= _WIDE
    return out, sum(parallel_map(operator.call, filters) if wide else (one() for one in filters))


def whitened(
    tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, chosen: Sequence[int] | None = None
) -> Floats:
    """Innovations of all tracks, one below the other in the order of the masks, (tracks x samples, columns); of all
    columns or of the ``chosen`` ones."""
    samples, (columns, kind) = len(frame.log_start), next((one.shape[1], one.dtype) for one in tracks.values())
    columns = columns if chosen is None else len(chosen)
    joined = np.empty((len(frame.names) * samples, columns), kind)
    parts = {name: joined[k * samples : (k + 1) * samples] for k, name in enumerate(frame.names)}
    whiten(tracks, frame, noise, parts, chosen)
    return joined


def white_variance(name: str, track: ChannelNoise, frame: SampleMasks) -> Floats:
    """Variance of the white noise of a track, (samples,); 0 where it is not compared."""
    variance: float | Floats = track.a**2
    if track.b:
        variance = variance + (track.b * frame.speed_mps / REFERENCE_MPS) ** 2
    if name in frame.jitter_variance:
        variance = variance + frame.jitter_variance[name]
    return np.asarray(variance * frame.present[name])


def scale_of(name: str, frame: SampleMasks, noise: Noise) -> Floats:
    """Factor of the standard deviation of a track, (samples,)."""
    scales = noise.scales.get(name)
    return (
        np.ones(len(frame.log_start)) if scales is None else np.asarray(scales[np.asarray(frame.segment_id, np.int64)])
    )


def ar1_coefficient(tau_s: float, step_s: float) -> float:
    """AR(1) coefficient of coloured noise of time constant ``tau_s`` at sample time ``step_s``."""
    return float(np.exp(-step_s / max(tau_s, 1e-3)))


def _whiten_longitudinal(
    every: Mapping[str, Floats], frame: SampleMasks, noise: Noise, out: Mapping[str, Floats],
    chosen: Sequence[int] | None,
) -> float:  # fmt: skip
    tracks = {name: _columns(every[name], chosen) for name in LONGITUDINAL if name in every}
    scale, white = scale_of("long", frame, noise), np.zeros((len(frame.log_start), 3))
    likelihood, measured = 0.0, [name for name in LONGITUDINAL if name in tracks]
    for name in measured:
        likelihood -= float(np.log(scale) @ frame.present[name])
        white[:, LONGITUDINAL.index(name)] = white_variance(name, noise.tracks[name], frame)
    taus = [tau_s for _, tau_s in noise.disturbances]
    phi = np.array([[ar1_coefficient(tau_s, frame.sample_s)] for tau_s in taus])
    on = 1.0 if noise.enabled else 0.0
    colour = np.array([[on * size**2 + 1e-12] for size, _ in noise.disturbances])
    share = frame.speed_mps / REFERENCE_MPS
    unmeasured = np.empty_like(tracks[measured[0]]) if len(measured) < len(LONGITUDINAL) else None
    columns = tuple(np.ascontiguousarray(tracks.get(name, unmeasured)) for name in LONGITUDINAL)
    outs = tuple(out.get(name, unmeasured) for name in LONGITUDINAL)
    masks = (frame.log_start, frame.segment_start, frame.moving)
    return likelihood + float(
        longitudinal_innovations(columns, scale, *masks, white, share, frame.sample_s, phi, colour, outs)
    )


def _columns(values: Floats, chosen: Sequence[int] | None) -> Floats:
    return values if chosen is None else np.ascontiguousarray(values[:, list(chosen)])


def _whiten_channel(
    name: str, every: Floats, frame: SampleMasks, noise: Noise, out: Floats, chosen: Sequence[int] | None
) -> float:
    values = _columns(every, chosen)
    track, scale = noise.tracks[name], scale_of(name, frame, noise)
    white = white_variance(name, track, frame)
    colour = track.c**2 if noise.enabled else 0.0
    keep = ar1_coefficient(track.tau_s, frame.sample_s)
    value = channel_innovations(values, scale, frame.log_start, white, keep, colour + 1e-16, out)
    return float(value) - float(np.log(scale) @ frame.present[name])

"""The noise model: sensor noise and coloured disturbances, and residuals whitened by them."""

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hil.diagnosis.data.dataset import SINGLES, Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import channel_innovations, longitudinal_innovations
from hil.diagnosis.parallel import parallel_map

Stack = Mapping[str, Floats]
REFERENCE_MPS = 20.0
MODES = np.array([[0.25, 0.25, 0.25, 0.25], [0.25, 0.25, -0.25, -0.25], [0.5, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]])
MODE_NAMES = ("mean", "front-rear", "left-right front", "left-right rear")
_SWING_S = 0.3
LONGITUDINAL = ("wheel.mean", "ax", "gps")
_WIDE = 8  # columns from which on threads are worth their while


@dataclass(frozen=True, eq=False)
class ChannelNoise:
    """Noise of one track: white variance a^2 + (b v / 20)^2, AR(1) of standard deviation c and time constant tau."""

    a: float
    b: float
    c: float
    tau_s: float


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of all tracks.

    ``disturbances``: force, slope, accelerometer (standard deviation m/s2, tau s), what all wheels tell wrong (m/s at
    20 m/s, tau s), and what the ground speed does (m/s, tau s) where there is one.

    ``scales``: by how much a manoeuvre is noisier than the others (one number each), per track; the moving car's
    tracks share those of "long". Where the car is driven hard the model's own error is larger too.
    ``enabled`` False keeps white sensor noise alone: what every test of a free-running simulation must not do.
    """

    tracks: Mapping[str, ChannelNoise]
    disturbances: tuple[tuple[float, float], ...]
    enabled: bool = True
    scales: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SampleMasks:
    """What does not change with the residual: masks, starts, speeds, per sample of all drives.

    ``waited`` is the variance of each track that comes of frames that wait for the bus: its slope times their time.
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
        """Of a case."""
        fresh, restart = [], []
        for drive in case.recordings:
            begin, again = np.zeros(drive.samples), np.zeros(drive.samples)
            begin[0] = 1.0
            for segment in drive.segments[1:]:
                again[segment.first // drive.stride] = 1.0
            fresh.append(begin)
            restart.append(again)
        tracks: dict[str, list[Floats]] = {}
        for drive in case.recordings:
            for group, values in drive.measured.items():
                shown = _known(group, values, drive.moving, drive.resting)
                for name, known in shown.items():
                    tracks.setdefault(name, []).append(known * drive.compared.get(name, 1.0))
        present = {name: np.concatenate(parts) for name, parts in tracks.items()}
        begun = np.concatenate(restart)  # a lag mixes the first sample with those before, a body in a bend swings in
        swings = np.convolve(begun, np.ones(int(np.ceil(_SWING_S / case.sample_s))))[: len(begun)]
        present = {
            name: np.where((swings if name in ("ay", "yaw") else begun) > 0.5, 0.0, known)
            for name, known in present.items()
        }
        twice = _redundant_channels(case)
        present = {name: known for name, known in present.items() if known.sum() > 50 and name not in twice}
        return cls(
            np.concatenate(fresh), np.concatenate(restart), np.concatenate([d.moving for d in case.recordings]) * 1.0,
            np.concatenate([d.speed_mps for d in case.recordings]), case.segment_ids(), case.sample_s, present,
            tuple(present), _jitter_variance(case),
        )  # fmt: skip


def _redundant_channels(case: Dataset) -> set[str]:
    """Tracks of the torques where motors act at one axle alone: what front and rear differ by is the mean again."""
    torques = [np.nan_to_num(drive.measured["motor"]) for drive in case.recordings if "motor" in drive.measured]
    acts = [any(one[:, axle].any() for one in torques) for axle in (slice(0, 2), slice(2, 4))]
    if acts[0] == acts[1]:
        return set()
    return {"motor.front-rear", f"motor.left-right {'rear' if acts[0] else 'front'}"}


def _jitter_variance(case: Dataset) -> dict[str, Floats]:
    """Variance by waiting of all tracks but the wheels', whose stamps are the log's.

    At a corner the steeper side counts; two rows of a sample wait apart.
    """
    found: dict[str, list[Floats]] = {}
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
                found.setdefault(name, []).append(column)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _known(group: str, values: Floats, moving_now: Floats, resting: Floats) -> dict[str, Floats]:
    """Tracks of a group and where they are compared."""
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
    """Residuals or sensitivities (samples, channels) of groups as tracks (samples, 1); wheel speeds as m/s."""
    found: dict[str, Floats] = {}
    for group, values in stack.items():
        if group in SINGLES:
            found[group] = values
            continue
        factor = radius_m if group == "wheel" else 1.0
        if group == "wheel" and "wheel.front-rear" not in frame.names:
            found["wheel.mean"] = factor * np.nanmean(values, axis=1, keepdims=True)
            continue
        modes = values @ (factor * MODES.T)
        found |= {f"{group}.{mode}": modes[:, k : k + 1] for k, mode in enumerate(MODE_NAMES)}
    return {name: np.where(np.isnan(values), 0.0, values) for name, values in found.items() if name in frame.names}


def whiten(
    tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, into: Mapping[str, Floats] | None = None
) -> tuple[dict[str, Floats], float]:
    """Innovations by track, (samples, columns), in the precision given, and the log-likelihood of the first column.

    They are written ``into`` arrays by track, where these are given.
    """
    out = {name: np.empty_like(values) for name, values in tracks.items()} if into is None else dict(into)
    apart: list[Callable[[], float]] = [
        partial(_whiten_channel, name, values, frame, noise, out[name])
        for name, values in tracks.items()
        if name not in LONGITUDINAL
    ]
    if any(name in tracks for name in LONGITUDINAL):
        apart.insert(0, partial(_whiten_longitudinal, tracks, frame, noise, out))
    wide = max((values.shape[1] for values in tracks.values()), default=0) >= _WIDE
    return out, sum(parallel_map(operator.call, apart) if wide else (one() for one in apart))


def whitened(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise) -> Floats:
    """Innovations of all tracks, one below the other in the frame's order, (tracks samples, columns)."""
    samples, (columns, kind) = len(frame.log_start), next((one.shape[1], one.dtype) for one in tracks.values())
    joined = np.empty((len(frame.names) * samples, columns), kind)
    parts = {name: joined[k * samples : (k + 1) * samples] for k, name in enumerate(frame.names)}
    whiten(tracks, frame, noise, parts)
    return joined


def white_variance(name: str, track: ChannelNoise, frame: SampleMasks) -> Floats:
    """Variance of the white noise of a track, by sample; 0 where nothing is known."""
    variance: float | Floats = track.a**2
    if track.b:
        variance = variance + (track.b * frame.speed_mps / REFERENCE_MPS) ** 2
    if name in frame.jitter_variance:
        variance = variance + frame.jitter_variance[name]
    return np.asarray(variance * frame.present[name])


def scale_of(name: str, frame: SampleMasks, noise: Noise) -> Floats:
    """Scale of every sample."""
    scales = noise.scales.get(name)
    return (
        np.ones(len(frame.log_start)) if scales is None else np.asarray(scales[np.asarray(frame.segment_id, np.int64)])
    )


def ar1_coefficient(tau_s: float, step_s: float) -> float:
    """What is left of coloured noise from sample to sample."""
    return float(np.exp(-step_s / max(tau_s, 1e-3)))


def _whiten_longitudinal(
    tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, out: Mapping[str, Floats]
) -> float:
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


def _whiten_channel(name: str, values: Floats, frame: SampleMasks, noise: Noise, out: Floats) -> float:
    track, scale = noise.tracks[name], scale_of(name, frame, noise)
    white = white_variance(name, track, frame)
    colour = track.c**2 if noise.enabled else 0.0
    keep = ar1_coefficient(track.tau_s, frame.sample_s)
    value = channel_innovations(values, scale, frame.log_start, white, keep, colour + 1e-16, out)
    return float(value) - float(np.log(scale) @ frame.present[name])

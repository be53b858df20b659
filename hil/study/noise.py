"""The noise model: sensor noise and coloured disturbances, estimated from the logs before anything is tested."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize

from hil.study.prepare import SINGLES, Case
from hil.study.table import Floats
from hil.study.whiten import HUBER, coloured, moving

Stack = Mapping[str, Floats]
_REFERENCE_MPS = 20.0
MODES = np.array([[0.25, 0.25, 0.25, 0.25], [0.25, 0.25, -0.25, -0.25], [0.5, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]])
MODE_NAMES = ("mean", "front-rear", "left-right front", "left-right rear")
_FLOOR = {"wheel": 5e-4, "ax": 2e-3, "gps": 2e-3, "ay": 2e-3, "yaw": 2e-4, "pressure": 500.0, "motor": 0.05}
_LONGEST_S = 2.0  # what is slower is no noise but wants a cause
_SWING_S = 0.3
_USUAL = np.array([0.05, 0.03, 0.03, 0.005, 1.0, 3.0, 2.0, 1.0])
_SPREAD = np.array([1.5, 1.5, 1.5, 1.5, 0.7, 0.7, 0.7, 0.7])
"""Disturbances that roads, drivers and sensors usually make (sizes, then times), and the spread of their logarithms."""
_PRIOR_SAMPLES, _SCALES = 60.0, (0.4, 8.0)
_LONG = ("wheel.mean", "ax", "gps")


@dataclass(frozen=True, eq=False)
class Track:
    """Noise of one track: white variance a^2 + (b v / 20)^2, AR(1) of standard deviation c and time constant tau."""

    a: float
    b: float
    c: float
    tau_s: float


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of all tracks.

    ``disturbances``: force, slope, accelerometer (standard deviation m/s2, tau s) and what all wheels tell wrong
    (m/s at 20 m/s, tau s).

    ``scales``: by how much a manoeuvre is noisier than the others (one number each), per track; the moving car's
    tracks share those of "long". Where the car is driven hard the model's own error is larger too.
    ``enabled`` False keeps white sensor noise alone: what every test of a free-running simulation must not do.
    """

    tracks: Mapping[str, Track]
    disturbances: tuple[tuple[float, float], ...]
    enabled: bool = True
    scales: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Frame:
    """What does not change with the residual: masks, starts, speeds, per sample of all drives.

    ``waited`` is the variance of each track that comes of frames that wait for the bus: its slope times their time.
    """

    fresh: Floats
    restart: Floats
    moving: Floats
    speed_mps: Floats
    blocks: Floats
    sample_s: float
    present: Mapping[str, Floats]
    names: tuple[str, ...]
    waited: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, case: Case) -> "Frame":
        """Of a case."""
        fresh, restart = [], []
        for drive in case.drives:
            begin, again = np.zeros(drive.samples), np.zeros(drive.samples)
            begin[0] = 1.0
            for segment in drive.segments[1:]:
                again[segment.first // drive.stride] = 1.0
            fresh.append(begin)
            restart.append(again)
        tracks: dict[str, list[Floats]] = {}
        for drive in case.drives:
            for group, values in drive.measured.items():
                shown = _known(group, values, drive.moving, drive.resting)
                for name, known in shown.items():
                    tracks.setdefault(name, []).append(known)
        present = {name: np.concatenate(parts) for name, parts in tracks.items()}
        begun = np.concatenate(restart)  # a lag mixes the first sample with those before, a body in a bend swings in
        swings = np.convolve(begun, np.ones(int(np.ceil(_SWING_S / case.sample_s))))[: len(begun)]
        present = {
            name: np.where((swings if name in ("ay", "yaw") else begun) > 0.5, 0.0, known)
            for name, known in present.items()
        }
        present = {name: known for name, known in present.items() if known.sum() > 50}
        return cls(
            np.concatenate(fresh), np.concatenate(restart), np.concatenate([d.moving for d in case.drives]) * 1.0,
            np.concatenate([d.speed_mps for d in case.drives]), case.blocks(), case.sample_s, present, tuple(present),
            _waited(case),
        )  # fmt: skip


def _waited(case: Case) -> dict[str, Floats]:
    """Variance by waiting of all tracks but the wheels', whose stamps are the log's.

    At a corner the steeper side counts; two rows of a sample wait apart.
    """
    found: dict[str, list[Floats]] = {}
    for drive in case.drives:
        wait = drive.wait_s / (drive.stride**0.5 * case.sample_s)
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


def tracks_of(stack: Stack, frame: Frame, radius_m: float) -> dict[str, Floats]:
    """Residuals or sensitivities by track; wheel speeds as m/s. Arrays are (samples, channels, columns) by group."""
    found: dict[str, Floats] = {}
    for group, values in stack.items():
        if group in SINGLES:
            found[group] = values[:, 0]
            continue
        factor = radius_m if group == "wheel" else 1.0
        if group == "wheel" and "wheel.front-rear" not in frame.names:
            found["wheel.mean"] = factor * np.nanmean(values, axis=1)
            continue
        for mode, weights in zip(MODE_NAMES, MODES, strict=True):
            found[f"{group}.{mode}"] = factor * np.einsum("c,sck->sk", weights, values)
    return {name: np.nan_to_num(values) for name, values in found.items() if name in frame.names}


def whiten(tracks: Mapping[str, Floats], frame: Frame, noise: Noise) -> tuple[dict[str, Floats], float]:
    """Innovations by track, (samples, columns), and the log-likelihood of the first column."""
    out: dict[str, Floats] = {}
    total = 0.0
    columns = next(iter(tracks.values())).shape[1]
    there = [name for name in _LONG if name in tracks]
    if there:
        value, found = _long(tracks, frame, noise, columns)
        total += value
        out |= found
    for name, values in tracks.items():
        if name not in _LONG:
            value, out[name] = _side(name, values, frame, noise)
            total += value
    return out, total


def _white(name: str, track: Track, frame: Frame) -> Floats:
    """Variance of the white noise of a track, by sample; 0 where nothing is known."""
    variance: float | Floats = track.a**2
    if track.b:
        variance = variance + (track.b * frame.speed_mps / _REFERENCE_MPS) ** 2
    if name in frame.waited:
        variance = variance + frame.waited[name]
    return np.asarray(variance * frame.present[name])


def _scale(name: str, frame: Frame, noise: Noise) -> Floats:
    """Scale of every sample."""
    scales = noise.scales.get(name)
    return np.ones(len(frame.fresh)) if scales is None else np.asarray(scales[np.asarray(frame.blocks, np.int64)])


def _limited(innovations: Floats) -> Floats:
    """Squares, but proportional to the size beyond what the likelihood squares."""
    return np.asarray(np.minimum(innovations**2, HUBER * np.abs(innovations)))


def rescaled(tracks: Mapping[str, Floats], frame: Frame, noise: Noise) -> Noise:
    """Scales of the manoeuvres from the innovations, weak ones drawn towards 1."""
    whitened, _ = whiten(tracks, frame, noise)
    blocks = np.asarray(frame.blocks, np.int64)
    count = int(blocks.max()) + 1
    found: dict[str, Floats] = {}
    for name in ("long", *(track for track in tracks if track not in _LONG)):
        members = [track for track in _LONG if track in tracks] if name == "long" else [name]
        squares = sum(np.bincount(blocks, _limited(whitened[m][:, 0]), count) for m in members)
        samples = sum(np.bincount(blocks, frame.present[m], count) for m in members)
        share = np.sqrt((squares + _PRIOR_SAMPLES) / (samples + _PRIOR_SAMPLES))
        before = noise.scales.get(name)
        found[name] = np.clip(share if before is None else share * before, *_SCALES)
    return replace(noise, scales=found)


def _factor(tau_s: float, step_s: float) -> float:
    return float(np.exp(-step_s / max(tau_s, 1e-3)))


def _long(tracks: Mapping[str, Floats], frame: Frame, noise: Noise, columns: int) -> tuple[float, dict[str, Floats]]:
    samples = len(frame.fresh)
    y, white = np.zeros((samples, 3, columns)), np.zeros((samples, 3))
    scale = _scale("long", frame, noise)
    likelihood = 0.0
    for m, name in enumerate(_LONG):
        if name in tracks:
            y[:, m] = tracks[name] / scale[:, None]
            likelihood -= float(np.log(scale) @ frame.present[name])
            white[:, m] = _white(name, noise.tracks[name], frame)
    on = 1.0 if noise.enabled else 0.0
    colours = np.array([(_factor(tau, frame.sample_s), on * size**2 + 1e-12) for size, tau in noise.disturbances])
    out = np.empty_like(y)
    share = frame.speed_mps / _REFERENCE_MPS
    value = moving(y, frame.fresh, frame.restart, white, share, frame.sample_s, colours, out)
    return likelihood + float(value), {name: out[:, m] for m, name in enumerate(_LONG) if name in tracks}


def _side(name: str, values: Floats, frame: Frame, noise: Noise) -> tuple[float, Floats]:
    scaled, value = _evened(name, values, frame, noise)
    out = np.empty_like(scaled)
    return value + _filtered(name, noise.tracks[name], scaled, frame, noise.enabled, out), out


def _evened(name: str, values: Floats, frame: Frame, noise: Noise) -> tuple[Floats, float]:
    """Values of a track over the scale of their manoeuvre, and what that adds to the log-likelihood."""
    scale = _scale(name, frame, noise)
    return np.ascontiguousarray(values / scale[:, None]), -float(np.log(scale) @ frame.present[name])


def _filtered(name: str, track: Track, scaled: Floats, frame: Frame, enabled: bool, out: Floats) -> float:
    """Innovations of an evened track into ``out``, and their log-likelihood."""
    white = _white(name, track, frame)
    colour = track.c**2 if enabled else 0.0
    return float(coloured(scaled, frame.fresh, white, _factor(track.tau_s, frame.sample_s), colour + 1e-16, out))


def first_guess(tracks: Mapping[str, Floats], frame: Frame, enabled: bool = True) -> Noise:
    """Sensor noise from second differences of the residual, disturbances of what a road and a driver make."""
    found = {}
    for name, values in tracks.items():
        a = max(_differences(values[:, 0], frame.present[name]), _FLOOR[name.split(".")[0]])
        found[name] = Track(a, 1e-6, 3.0 * a, 0.5)
    return Noise(found, tuple(zip(_USUAL[:4].tolist(), _USUAL[4:].tolist(), strict=True)), enabled)


def _differences(values: Floats, known: Floats) -> float:
    both = (known[2:] > 0.5) & (known[1:-1] > 0.5) & (known[:-2] > 0.5)
    second = (values[2:] - 2.0 * values[1:-1] + values[:-2])[both]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if second.size else 0.0


def estimate(tracks: Mapping[str, Floats], frame: Frame, start: Noise, budget: int = 160) -> Noise:
    """Noise of largest likelihood for residual tracks (samples, 1)."""
    noise = start
    for _ in range(1 if start.scales else 2):
        for name, values in tracks.items():
            if name not in _LONG:
                noise = _estimate_side(name, values, frame, noise, budget)
        noise = rescaled(tracks, frame, _estimate_long(tracks, frame, noise, 2 * budget))
    return noise


def _estimate_side(name: str, values: Floats, frame: Frame, noise: Noise, budget: int) -> Noise:
    floor = _FLOOR[name.split(".")[0]]
    at = noise.tracks[name]
    by_speed = name.startswith("wheel")

    scaled, _ = _evened(name, values, frame, noise)
    out = np.empty_like(scaled)

    def built(z: Floats) -> Track:
        a, b, c, tau = (float(size) for size in np.exp(z))
        return Track(max(a, floor), b if by_speed else 0.0, c, min(max(tau, 0.02), _LONGEST_S))

    def cost(z: Floats) -> float:
        beyond = np.clip(np.abs(z) - 16.0, 0.0, None)
        return -_filtered(name, built(z), scaled, frame, noise.enabled, out) + 1e-3 * float(beyond @ beyond)

    a = max(_differences(values[:, 0], frame.present[name]), floor)
    quiet = Track(a, 0.0, 3.0 * a, 0.5)
    starts = [np.log([one.a, max(one.b, 0.3 * one.a), one.c, one.tau_s]) for one in (at, quiet)]
    best = minimize(
        cost, min(starts, key=cost), method="Nelder-Mead", options={"maxfev": budget, "xatol": 0.02, "fatol": 0.05}
    )
    return replace(noise, tracks={**noise.tracks, name: built(best.x)})


def _estimate_long(tracks: Mapping[str, Floats], frame: Frame, noise: Noise, budget: int) -> Noise:
    there = [name for name in _LONG if name in tracks]
    if not there:
        return noise

    def built(z: Floats) -> Noise:
        sizes = np.exp(z)
        changed = dict(noise.tracks)
        for k, name in enumerate(there):
            a = max(float(sizes[8 + k]), _FLOOR[name.split(".")[0]])
            b = noise.tracks["wheel.front-rear"].b if name == "wheel.mean" and "wheel.front-rear" in changed else 0.0
            changed[name] = Track(a, b, 0.0, 1.0)
        taus = np.clip(sizes[4:8], 0.02, 30.0)
        pairs = tuple((float(s), float(t)) for s, t in zip(sizes[:4], taus, strict=True))
        return replace(noise, tracks=changed, disturbances=pairs)

    def cost(z: Floats) -> float:
        # weak knowledge of sizes and times keeps what the data do not show where roads and cars have it
        return -_long(tracks, frame, built(z), 1)[0] + 0.5 * float(np.sum(((z[:8] - np.log(_USUAL)) / _SPREAD) ** 2))

    sizes, taus = zip(*noise.disturbances, strict=True)
    white = np.log([noise.tracks[name].a for name in there])
    starts = [np.concatenate((np.log([*sizes, *taus]), white)), np.concatenate((np.log(_USUAL), white))]
    best = minimize(
        cost, min(starts, key=cost), method="L-BFGS-B", options={"maxfun": budget, "eps": 1e-3, "ftol": 1e-8}
    )
    return built(best.x)

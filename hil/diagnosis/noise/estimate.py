"""The noise of largest likelihood for what a simulation leaves of a log."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats
from hil.diagnosis.noise.innovations import HUBER, channel_likelihoods, longitudinal_likelihoods
from hil.diagnosis.noise.model import (
    LONGITUDINAL,
    REFERENCE_MPS,
    ChannelNoise,
    Noise,
    SampleMasks,
    scale_of,
    white_variance,
    whiten,
)
from hil.diagnosis.parallel import parallel_map

_FLOOR = {"wheel": 5e-4, "ax": 2e-3, "gps": 2e-3, "ay": 2e-3, "yaw": 2e-4, "pressure": 500.0, "motor": 0.05}
_SHORTEST_S, _LONGEST_S, _LONGEST_MOVING_S = 0.02, 2.0, 30.0  # what is slower is no noise but wants a cause
_TYPICAL = ((0.05, 1.0), (0.03, 3.0), (0.03, 2.0), (0.005, 1.0), (0.03, 2.0))
_SPREAD = (1.5, 0.7)
"""Disturbances that roads, drivers and sensors usually make (size, time), as in `hil.diagnosis.noise.model.Noise`, and
the spread of their logarithms."""
_COLOURS, _TIMES_S = (0.1, 0.3, 1.0, 3.0), (0.1, 0.5, 2.0)
"""Offered to begin a search: colour as a share of the white noise, and its time. From too much of it the way down leads
past what is there to none at all, where nothing points back."""
_PRIOR_SAMPLES, _SCALES = 60.0, (0.4, 8.0)
_DIFFERENCE, _SETTLED, _FAR = 1e-3, 5e-3, 16.0
"""Of the search, in logarithms: step of a difference, how little less cost is worth no step, and how far it goes."""
_STEPS, _FARTHEST, _RIDGE = 30, 2.0, 1e-3
"""Steps at most, how far one goes, and information where innovations have none."""
Costs = Callable[[Floats], tuple[Floats, Floats, Floats]]
"""Negative log-likelihoods of points, (points,); innovations and their variances, (samples, points)."""


def first_guess(tracks: Mapping[str, Floats], frame: SampleMasks, enabled: bool = True) -> Noise:
    """Sensor noise from second differences of the residual, disturbances of what a road and a driver make."""
    found = {}
    for name, values in tracks.items():
        a = max(_differences(values[:, 0], frame.present[name]), _floor(name))
        found[name] = ChannelNoise(a, 1e-6, 3.0 * a, 0.5)
    return Noise(found, _TYPICAL if "gps" in tracks else _TYPICAL[:-1], enabled)


def _floor(track: str) -> float:
    return _FLOOR[track.split(".")[0]]


def _differences(values: Floats, known: Floats) -> float:
    both = (known[2:] > 0.5) & (known[1:-1] > 0.5) & (known[:-2] > 0.5)
    second = (values[2:] - 2.0 * values[1:-1] + values[:-2])[both]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if second.size else 0.0


def estimate(tracks: Mapping[str, Floats], frame: SampleMasks, start: Noise) -> Noise:
    """Noise of largest likelihood for residual tracks (samples, 1)."""
    noise = start
    for _ in range(1 if start.scales else 2):
        sides = [name for name in tracks if name not in LONGITUDINAL]
        found = parallel_map(partial(_channel_noise, tracks, frame, noise), sides)
        noise = replace(noise, tracks={**noise.tracks, **dict(zip(sides, found, strict=True))})
        noise = _rescaled(tracks, frame, _longitudinal_noise(tracks, frame, noise))
    return noise


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a search is: the cost there, its slope, and the information of the numbers."""

    z: Floats
    cost: float
    slope: Floats
    information: Floats

    def step(self, low: Floats, high: Floats, damping: float) -> tuple[Floats, float]:
        """The way to the least cost by what is known here, and how much less that would be."""
        free = ~(((self.z <= low) & (self.slope > 0.0)) | ((self.z >= high) & (self.slope < 0.0)))
        a = self.information[np.ix_(free, free)]
        step = np.zeros_like(self.z)
        step[free] = np.linalg.solve(a + np.diag(damping * np.diag(a) + _RIDGE), -self.slope[free])
        return step, -0.5 * float(self.slope @ step)


@compiled
def information_matrix(innovations: Floats, variances: Floats, limit: float) -> Floats:
    """Information of parameters by which innovations and their variances, (samples, 1 + parameters), differ.

    The first column is at the point, each other one a step of one parameter from it; (parameters, parameters) by
    these steps. Innovations beyond ``limit`` standard deviations count less, as in the likelihood (Gupta and Mehra
    1974, IEEE Trans. AC 19, 774).
    """
    count = innovations.shape[1] - 1
    information, moved, grown = np.zeros((count, count)), np.zeros(count), np.zeros(count)
    for t in range(len(innovations)):
        inverse = 1.0 / variances[t, 0]
        size = abs(innovations[t, 0]) * np.sqrt(inverse)
        weight = inverse * (limit / size if size > limit else 1.0)
        half = 0.5 * inverse * inverse
        for k in range(count):
            moved[k] = innovations[t, 1 + k] - innovations[t, 0]
            grown[k] = variances[t, 1 + k] - variances[t, 0]
        for i in range(count):
            for k in range(count):
                information[i, k] += weight * moved[i] * moved[k] + half * grown[i] * grown[k]
    return information


def _minimise(costs: Costs, starts: Sequence[Floats], low: Floats, high: Floats, known: Floats) -> Floats:
    """Where the cost is least: from the first start if it is there already, else from the best of all, by scoring.

    ``costs`` takes points, (points, numbers), all at once. Steps are those of the information that innovations have of
    the numbers (Gupta and Mehra 1974, IEEE Trans. AC 19, 774), and of what is ``known`` of them before, damped after
    Marquardt (1963).
    """
    steps = _DIFFERENCE * np.eye(len(low))

    def here(z: Floats) -> _Place:
        found, off, size = costs(np.vstack([z, z + steps]))
        information = information_matrix(off, size, HUBER) / _DIFFERENCE**2 + np.diag(known)
        return _Place(z, float(found[0]), (found[1:] - found[0]) / _DIFFERENCE, information)

    offered = np.clip(starts, low, high)
    now, damping = here(offered[0]), 0.0
    if now.step(low, high, 0.0)[1] < _SETTLED:
        return now.z
    found = costs(offered)[0]
    if np.argmin(found):
        now = here(offered[int(np.argmin(found))])
    for _ in range(_STEPS):
        step, foretold = now.step(low, high, damping)
        if foretold < _SETTLED:
            break
        there = here(np.clip(now.z + np.clip(step, -_FARTHEST, _FARTHEST), low, high))
        if there.cost < now.cost:
            now, damping = there, 0.1 * damping
        else:
            damping = max(10.0 * damping, 0.1)
    return now.z


def _channel_noise(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, name: str) -> ChannelNoise:
    """Noise of a track that all others say nothing of."""
    values, at, floor, known = tracks[name], noise.tracks[name], _floor(name), frame.present[name]
    scale = scale_of(name, frame, noise)
    common = white_variance(name, ChannelNoise(0.0, 0.0, 0.0, 1.0), frame)
    faster = np.square(frame.speed_mps / REFERENCE_MPS)
    by_speed = name.startswith("wheel")

    def costs(points: Floats) -> tuple[Floats, Floats, Floats]:
        a, c, tau_s, *more = np.exp(points.T)
        white = common[:, None] + a**2 + (faster[:, None] * more[0] ** 2 if more else 0.0)
        colour = (c**2 if noise.enabled else 0.0 * c) + 1e-16
        phi = np.exp(-frame.sample_s / tau_s)
        off, size = np.zeros(white.shape), np.ones(white.shape)
        return -channel_likelihoods(values, scale, frame.log_start, known, white, phi, colour, off, size), off, size

    a = max(_differences(values[:, 0], known), floor)
    offered = [at, *(ChannelNoise(a, 0.0, share * a, tau_s) for share in _COLOURS for tau_s in _TIMES_S)]
    starts = [np.log([one.a, one.c, one.tau_s, max(one.b, 0.3 * one.a)]) for one in offered]
    low = np.array([np.log(floor), -_FAR, np.log(_SHORTEST_S), -_FAR])
    high = np.array([_FAR, _FAR, np.log(_LONGEST_S), _FAR])
    count = 4 if by_speed else 3
    found = np.exp(
        _minimise(costs, [start[:count] for start in starts], low[:count], high[:count], np.zeros(count))
    ).tolist()
    return ChannelNoise(found[0], found[3] if by_speed else 0.0, found[1], found[2])


def _longitudinal_noise(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise) -> Noise:
    """Noise with that of the moving car's tracks, and of all that disturbs it."""
    there = [name for name in LONGITUDINAL if name in tracks]
    if not there:
        return noise
    samples, scale, count = len(frame.log_start), scale_of("long", frame, noise), len(noise.disturbances)
    usual, spread = np.log(np.array(_TYPICAL[:count]).T.ravel()), np.repeat(_SPREAD, count)
    share = frame.speed_mps / REFERENCE_MPS
    b = noise.tracks["wheel.front-rear"].b if "wheel.front-rear" in noise.tracks else 0.0
    columns = tuple(np.ascontiguousarray(tracks.get(name, tracks[there[0]]), np.float64) for name in LONGITUDINAL)
    known, white = np.zeros((samples, 3)), np.zeros((samples, 3))
    for name in there:
        m = LONGITUDINAL.index(name)
        known[:, m] = frame.present[name]
        white[:, m] = white_variance(name, ChannelNoise(0.0, b if name == "wheel.mean" else 0.0, 0.0, 1.0), frame)
    on, masks = 1.0 if noise.enabled else 0.0, (frame.log_start, frame.segment_start, frame.moving)

    def costs(points: Floats) -> tuple[Floats, Floats, Floats]:
        sizes = np.exp(points.T)
        sensor = np.zeros((3, len(points)))
        sensor[[LONGITUDINAL.index(name) for name in there]] = sizes[2 * count :] ** 2
        phi, colour = np.exp(-frame.sample_s / sizes[count : 2 * count]), on * sizes[:count] ** 2 + 1e-12
        off, size = np.zeros((3, samples, len(points))), np.ones((3, samples, len(points)))
        likelihoods = longitudinal_likelihoods(
            columns, scale, *masks, known, white, share, frame.sample_s, phi, colour, sensor, off, size
        )
        # weak knowledge of sizes and times keeps what the data do not show where roads and cars have it
        unusual = (points[:, : 2 * count] - usual) / spread
        cost = -likelihoods + 0.5 * np.square(unusual).sum(axis=1)
        return cost, off.reshape(-1, len(points)), size.reshape(-1, len(points))

    sizes, taus = zip(*noise.disturbances, strict=True)
    own = np.log([noise.tracks[name].a for name in there])
    starts = [np.concatenate((np.log([*sizes, *taus]), own)), np.concatenate((usual, own))]
    low = np.array([-_FAR] * count + [np.log(_SHORTEST_S)] * count + [np.log(_floor(name)) for name in there])
    high = np.array([_FAR] * count + [np.log(_LONGEST_MOVING_S)] * count + [_FAR] * len(there))
    before = np.array([*spread**-2, *np.zeros(len(there))])
    found = np.exp(_minimise(costs, starts, low, high, before)).tolist()
    disturbances, white_sizes = tuple(zip(found[:count], found[count : 2 * count], strict=True)), found[2 * count :]
    changed = {
        name: ChannelNoise(a, b if name == "wheel.mean" else 0.0, 0.0, 1.0)
        for name, a in zip(there, white_sizes, strict=True)
    }
    return replace(noise, tracks={**noise.tracks, **changed}, disturbances=disturbances)


def _limited(innovations: Floats) -> Floats:
    """Squares, but proportional to the size beyond what the likelihood squares."""
    return np.asarray(np.minimum(innovations**2, HUBER * np.abs(innovations)))


def _rescaled(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise) -> Noise:
    """Scales of the manoeuvres from the innovations, weak ones drawn towards 1."""
    innovations, _ = whiten(tracks, frame, noise)
    blocks = np.asarray(frame.segment_id, np.int64)
    count = int(blocks.max()) + 1
    found: dict[str, Floats] = {}
    for name in ("long", *(track for track in tracks if track not in LONGITUDINAL)):
        members = [track for track in LONGITUDINAL if track in tracks] if name == "long" else [name]
        squares = sum(np.bincount(blocks, _limited(innovations[m][:, 0]), count) for m in members)
        samples = sum(np.bincount(blocks, frame.present[m], count) for m in members)
        share = np.sqrt((squares + _PRIOR_SAMPLES) / (samples + _PRIOR_SAMPLES))
        before = noise.scales.get(name)
        found[name] = np.clip(share if before is None else share * before, *_SCALES)
    return replace(noise, scales=found)

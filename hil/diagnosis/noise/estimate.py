"""Estimate of the noise: largest likelihood of residuals, with weak priors on the disturbances along the road.

Takes residual tracks and a noise to start from; gives the noise. Every track but those along the road is estimated by
itself; then the scale of each segment.
"""

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
"""Least standard deviation of white noise by group of a track: m/s, m/s2, m/s, m/s2, rad/s, Pa, N m."""
_SHORTEST_S, _LONGEST_S, _LONGEST_MOVING_S = 0.02, 2.0, 30.0
"""Bounds of time constants; of disturbances along the road the last. A slower error is no noise, it has a cause."""
_TYPICAL = ((0.05, 1.0), (0.03, 3.0), (0.03, 2.0), (0.005, 1.0), (0.03, 2.0))
_SPREAD = (1.5, 0.7)
"""Prior of the disturbances along the road: typical (size, time constant), as in `hil.diagnosis.noise.model.Noise`, and
the standard deviations of the logarithms of both."""
_COLOURS, _TIMES_S = (0.1, 0.3, 1.0, 3.0), (0.1, 0.5, 2.0)
"""Starting points: coloured noise as a share of the white noise, and its time constant. From too much of it the descent
passes the optimum and ends at none at all, where the gradient is zero."""
_PRIOR_SAMPLES, _SCALES = 60.0, (0.4, 8.0)
"""Weight of scale 1, in samples, and bounds of a segment's scale."""
_DIFFERENCE, _SETTLED, _FAR = 1e-3, 5e-3, 16.0
"""In logarithms of the parameters: step of a finite difference; the decrease of the cost that ends the search, in half
chi-squared; the bound of the search."""
_STEPS, _FARTHEST, _RIDGE = 30, 2.0, 1e-3
"""Steps at most, the largest step of a logarithm, and information added where the innovations have none."""
Costs = Callable[[Floats], tuple[Floats, Floats, Floats]]
"""From points (points, parameters): negative log-likelihoods (points,), innovations and variances (samples, points)."""


def first_guess(tracks: Mapping[str, Floats], frame: SampleMasks, enabled: bool = True) -> Noise:
    """Sensor noise from second differences of the residual tracks (samples, 1), disturbances of typical size."""
    noises = {}
    for name, values in tracks.items():
        a = max(_differences(values[:, 0], frame.present[name]), _floor(name))
        noises[name] = ChannelNoise(a, 1e-6, 3.0 * a, 0.5)
    return Noise(noises, _TYPICAL if "gps" in tracks else _TYPICAL[:-1], enabled)


def _floor(track: str) -> float:
    return _FLOOR[track.split(".")[0]]


def _differences(values: Floats, known: Floats) -> float:
    """Standard deviation of white noise by the median of second differences, (samples,)."""
    both = (known[2:] > 0.5) & (known[1:-1] > 0.5) & (known[:-2] > 0.5)
    second = (values[2:] - 2.0 * values[1:-1] + values[:-2])[both]
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0)) if second.size else 0.0


def estimate(tracks: Mapping[str, Floats], frame: SampleMasks, start: Noise) -> Noise:
    """Noise of largest likelihood for residual tracks (samples, 1)."""
    noise = start
    for _ in range(1 if start.scales else 2):
        names = [name for name in tracks if name not in LONGITUDINAL]
        channels = parallel_map(partial(_channel_noise, tracks, frame, noise), names)
        noise = replace(noise, tracks={**noise.tracks, **dict(zip(names, channels, strict=True))})
        noise = _rescaled(tracks, frame, _longitudinal_noise(tracks, frame, noise))
    return noise


@dataclass(frozen=True, eq=False)
class _Point:
    """A point ``z`` of the search, the cost there, its gradient (parameters,) and the information matrix."""

    z: Floats
    cost: float
    gradient: Floats
    information: Floats

    def step(self, low: Floats, high: Floats, damping: float) -> tuple[Floats, float]:
        """Damped step to the least cost of the quadratic model here, and the decrease it predicts."""
        free = ~(((self.z <= low) & (self.gradient > 0.0)) | ((self.z >= high) & (self.gradient < 0.0)))
        a = self.information[np.ix_(free, free)]
        step = np.zeros_like(self.z)
        step[free] = np.linalg.solve(a + np.diag(damping * np.diag(a) + _RIDGE), -self.gradient[free])
        return step, -0.5 * float(self.gradient @ step)


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
    """The point of least cost, by scoring: from the first start if it is optimal already, else from the best start.

    ``costs`` takes points (points, parameters) all at once. Steps use the information that innovations have of the
    parameters (Gupta and Mehra 1974, IEEE Trans. AC 19, 774) and their prior information ``known``, damped after
    Marquardt (1963).
    """
    steps = _DIFFERENCE * np.eye(len(low))

    def linearised(z: Floats) -> _Point:
        values, innovations, variances = costs(np.vstack([z, z + steps]))
        information = information_matrix(innovations, variances, HUBER) / _DIFFERENCE**2 + np.diag(known)
        return _Point(z, float(values[0]), (values[1:] - values[0]) / _DIFFERENCE, information)

    offered = np.clip(starts, low, high)
    now, damping = linearised(offered[0]), 0.0
    if now.step(low, high, 0.0)[1] < _SETTLED:
        return now.z
    best = int(np.argmin(costs(offered)[0]))
    if best:
        now = linearised(offered[best])
    for _ in range(_STEPS):
        step, decrease = now.step(low, high, damping)
        if decrease < _SETTLED:
            break
        there = linearised(np.clip(now.z + np.clip(step, -_FARTHEST, _FARTHEST), low, high))
        if there.cost < now.cost:
            now, damping = there, 0.1 * damping
        else:
            damping = max(10.0 * damping, 0.1)
    return now.z


def _channel_noise(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise, name: str) -> ChannelNoise:
    """Noise of a track that is independent of all others."""
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
        innovations, variances = np.zeros(white.shape), np.ones(white.shape)
        likelihoods = channel_likelihoods(
            values, scale, frame.log_start, known, white, phi, colour, innovations, variances
        )
        return -likelihoods, innovations, variances

    a = max(_differences(values[:, 0], known), floor)
    offered = [at, *(ChannelNoise(a, 0.0, share * a, tau_s) for share in _COLOURS for tau_s in _TIMES_S)]
    starts = [np.log([one.a, one.c, one.tau_s, max(one.b, 0.3 * one.a)]) for one in offered]
    low = np.array([np.log(floor), -_FAR, np.log(_SHORTEST_S), -_FAR])
    high = np.array([_FAR, _FAR, np.log(_LONGEST_S), _FAR])
    count = 4 if by_speed else 3
    at_start = [start[:count] for start in starts]
    a, c, tau_s, *more = np.exp(_minimise(costs, at_start, low[:count], high[:count], np.zeros(count))).tolist()
    return ChannelNoise(a, more[0] if by_speed else 0.0, c, tau_s)


def _longitudinal_noise(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise) -> Noise:
    """The noise with that of the tracks along the road and their disturbances estimated."""
    measured = [name for name in LONGITUDINAL if name in tracks]
    if not measured:
        return noise
    samples, scale, count = len(frame.log_start), scale_of("long", frame, noise), len(noise.disturbances)
    typical, spread = np.log(np.array(_TYPICAL[:count]).T.ravel()), np.repeat(_SPREAD, count)
    share = frame.speed_mps / REFERENCE_MPS
    b = noise.tracks["wheel.front-rear"].b if "wheel.front-rear" in noise.tracks else 0.0
    columns = tuple(np.ascontiguousarray(tracks.get(name, tracks[measured[0]]), np.float64) for name in LONGITUDINAL)
    known, white = np.zeros((samples, 3)), np.zeros((samples, 3))
    for name in measured:
        m = LONGITUDINAL.index(name)
        known[:, m] = frame.present[name]
        white[:, m] = white_variance(name, ChannelNoise(0.0, b if name == "wheel.mean" else 0.0, 0.0, 1.0), frame)
    on, masks = 1.0 if noise.enabled else 0.0, (frame.log_start, frame.segment_start, frame.moving)

    def costs(points: Floats) -> tuple[Floats, Floats, Floats]:
        sizes = np.exp(points.T)
        sensor = np.zeros((3, len(points)))
        sensor[[LONGITUDINAL.index(name) for name in measured]] = sizes[2 * count :] ** 2
        phi, colour = np.exp(-frame.sample_s / sizes[count : 2 * count]), on * sizes[:count] ** 2 + 1e-12
        innovations, variances = np.zeros((3, samples, len(points))), np.ones((3, samples, len(points)))
        likelihoods = longitudinal_likelihoods(
            columns, scale, *masks, known, white, share, frame.sample_s, phi, colour, sensor, innovations, variances
        )
        # weak priors of sizes and times, for those the data do not determine
        deviation = (points[:, : 2 * count] - typical) / spread
        cost = -likelihoods + 0.5 * np.square(deviation).sum(axis=1)
        return cost, innovations.reshape(-1, len(points)), variances.reshape(-1, len(points))

    sizes, taus = zip(*noise.disturbances, strict=True)
    own = np.log([noise.tracks[name].a for name in measured])
    starts = [np.concatenate((np.log([*sizes, *taus]), own)), np.concatenate((typical, own))]
    low = np.array([-_FAR] * count + [np.log(_SHORTEST_S)] * count + [np.log(_floor(name)) for name in measured])
    high = np.array([_FAR] * count + [np.log(_LONGEST_MOVING_S)] * count + [_FAR] * len(measured))
    before = np.array([*spread**-2, *np.zeros(len(measured))])
    best = np.exp(_minimise(costs, starts, low, high, before)).tolist()
    disturbances, white_sizes = tuple(zip(best[:count], best[count : 2 * count], strict=True)), best[2 * count :]
    changed = {
        name: ChannelNoise(a, b if name == "wheel.mean" else 0.0, 0.0, 1.0)
        for name, a in zip(measured, white_sizes, strict=True)
    }
    return replace(noise, tracks={**noise.tracks, **changed}, disturbances=disturbances)


def _limited(innovations: Floats) -> Floats:
    """Squared innovations, continued linearly beyond `HUBER` as a weight (Huber 1964)."""
    return np.asarray(np.minimum(innovations**2, HUBER * np.abs(innovations)))


def _rescaled(tracks: Mapping[str, Floats], frame: SampleMasks, noise: Noise) -> Noise:
    """The noise with the scale of each segment by its innovations, with a prior at 1."""
    innovations, _ = whiten(tracks, frame, noise)
    blocks = np.asarray(frame.segment_id, np.int64)
    count = int(blocks.max()) + 1
    scales: dict[str, Floats] = {}
    for name in ("long", *(track for track in tracks if track not in LONGITUDINAL)):
        members = [track for track in LONGITUDINAL if track in tracks] if name == "long" else [name]
        squares = sum(np.bincount(blocks, _limited(innovations[m][:, 0]), count) for m in members)
        samples = sum(np.bincount(blocks, frame.present[m], count) for m in members)
        share = np.sqrt((squares + _PRIOR_SAMPLES) / (samples + _PRIOR_SAMPLES))
        before = noise.scales.get(name)
        scales[name] = np.clip(share if before is None else share * before, *_SCALES)
    return replace(noise, scales=scales)

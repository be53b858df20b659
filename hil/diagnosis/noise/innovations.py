"""Innovations and log-likelihood of residuals under the noise model: one Kalman filter and one AR(1) filter.

Takes residuals or Jacobian columns and the parameters of the noise; gives innovations (what the past does not predict)
and the log-likelihood. The filters are linear in the data, so least squares on innovations is the fit of largest
likelihood (Anderson and Moore 1979, Optimal Filtering, ch. 5).

Along the road, speed, acceleration and ground speed share one state x = (e, f, g, a, w, s):

- e, m/s: error of the simulated speed
- f, m/s2: force disturbance by mass (wind, rolling resistance), which moves the car and its accelerometer feels
- g, m/s2: slope disturbance, which moves the car; the accelerometer does not feel it
- a, m/s2: error of the accelerometer
- w, m/s: error that all wheel speeds share, at 20 m/s
- s, m/s: error of the ground speed; absent where none is logged

With T the sample time, v the speed, r = 1 where the car rolls and 0 where it is held:

- transition F, Q: e' = e + r T (f + g); d' = phi d + q for each disturbance d, phi = exp(-T / tau), var q =
  (1 - phi^2) c. A log starts at x = 0 with variances c and a diffuse e; a segment of it makes e diffuse anew;
- observation H, R: speed = e + (v / 20 m/s) w; acceleration = r f + a; ground speed = e + s; each with white noise R;
- update, one track after the other: S = H P H' + R, K = P H' / S, x += K (y - H x), P -= K S K'.

Every other track is one AR(1) disturbance with variance c and white noise: the same equations with H = 1, F = phi.

The log-likelihood is -1/2 sum(rho + log S) without its constant; rho is the square (y - H x)^2 / S, continued linearly
beyond `HUBER` standard deviations (Huber 1964, Ann. Math. Stat. 35, 73).

A filter runs over many columns with one noise (innovations for a fit), or over one column with many noises side by
side (*lanes*: likelihoods for the estimate of the noise). One body serves both, compiled twice: its last argument
``own`` is a constant, 1 where each column has a noise of its own and 0 where all share one.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numba import njit

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.log import Floats

HUBER = 6.0
"""Standard deviations beyond which an innovation counts linearly, not squared. No Gaussian noise reaches that far."""
DIFFUSE_VARIANCE = 1e4
"""Variance of an unknown speed error, (m/s)^2: 100 m/s is far above any real one."""
_SAMPLES_PER_LOGARITHM = 4
"""Variances of so many samples are multiplied before one logarithm is taken; their product stays a normal float."""
Three = tuple[Floats, Floats, Floats]
_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_inlined = cast(Callable[[_Kernel], _Kernel], njit(inline="always", error_model="numpy"))


class _Track(NamedTuple):
    """``y`` (samples, columns), its ``scale`` (samples,), where innovations and, with lanes, variances S go."""

    y: Floats
    scale: Floats
    out: Floats
    variance: Floats


class _Bank(NamedTuple):
    """Filters side by side: (columns,) of states, (lanes,) of covariances; one lane where all columns share a noise."""

    x: Floats  # (states, columns)
    cov: Floats  # (states, states, lanes): P
    h: Floats  # (states, lanes): P H'
    gained: Floats  # (columns,): (y - H x) / S
    total: Floats  # (lanes,): S
    inverse: Floats  # (lanes,): 1 / S
    product: Floats  # (lanes,): product of S since the last logarithm
    likelihood: Floats  # (lanes,)


@_inlined
def _bank(states: int, columns: int, own: int) -> _Bank:
    lanes = columns if own else 1
    return _Bank(
        np.zeros((states, columns)), np.zeros((states, states, lanes)), np.zeros((states, lanes)), np.zeros(columns),
        np.zeros(lanes), np.zeros(lanes), np.ones(lanes), np.zeros(lanes),
    )  # fmt: skip


@_inlined
def _start_log(bank: _Bank, colour: Floats, lanes: int) -> None:
    """x = 0, P = diag(diffuse, c)."""
    bank.x[:] = 0.0
    bank.cov[:] = 0.0
    bank.cov[0, 0] = DIFFUSE_VARIANCE
    for i in range(len(colour)):
        for k in range(lanes):
            bank.cov[1 + i, 1 + i, k] = colour[i, k]


@_inlined
def _start_segment(bank: _Bank) -> None:
    """The speed error is diffuse again, the disturbances go on."""
    bank.x[0] = 0.0
    bank.cov[0] = 0.0
    bank.cov[:, 0] = 0.0
    bank.cov[0, 0] = DIFFUSE_VARIANCE


@_inlined
def _mirror(cov: Floats) -> None:
    """Complete P, of which one half is made."""
    for i in range(cov.shape[0]):
        for j in range(i):
            for k in range(cov.shape[2]):
                cov[i, j, k] = cov[j, i, k]


@_inlined
def _predict(bank: _Bank, step: float, phi: Floats, colour: Floats, lanes: int, own: int) -> None:
    """x <- F x and P <- F P F' + Q, in place; ``step`` is r T."""
    x, cov, count = bank.x, bank.cov, len(phi)
    for k in range(x.shape[1]):
        x[0, k] += step * (x[1, k] + x[2, k])
    for j in range(1 + count):
        for k in range(lanes):
            cov[0, j, k] += step * (cov[1, j, k] + cov[2, j, k])
    for k in range(lanes):
        cov[0, 0, k] += step * (cov[0, 1, k] + cov[0, 2, k])
    for j in range(count):
        for k in range(x.shape[1]):
            x[1 + j, k] *= phi[j, own * k]
        for k in range(lanes):
            cov[0, 1 + j, k] *= phi[j, k]
            cov[1 + j, 0, k] = cov[0, 1 + j, k]
        for i in range(j + 1):  # of what is symmetric, one half
            for k in range(lanes):
                cov[1 + i, 1 + j, k] *= phi[i, k] * phi[j, k]
        for k in range(lanes):
            cov[1 + j, 1 + j, k] += (1.0 - phi[j, k] * phi[j, k]) * colour[j, k]
    _mirror(cov)


@_inlined
def _robust_square(square: float) -> float:
    """rho of a squared innovation of variance 1."""
    return 2.0 * HUBER * np.sqrt(square) - HUBER * HUBER if square > HUBER * HUBER else square


@_inlined
def _update(
    bank: _Bank, t: int, track: _Track, white: float, sensor: Floats, first: int, one: float, second: int,
    other: float, lanes: int, own: int,
) -> None:  # fmt: skip
    """Update by the sample of a track whose row H is ``one`` at the ``first`` state and ``other`` at the ``second``."""
    x, cov, h = bank.x, bank.cov, bank.h
    states, columns = x.shape
    even = 1.0 / track.scale[t]
    for i in range(states):
        for k in range(lanes):
            h[i, k] = one * cov[i, first, k] + other * cov[i, second, k]
    for k in range(lanes):
        total = white + sensor[k] + one * h[first, k] + other * h[second, k]
        bank.total[k], bank.inverse[k] = total, 1.0 / total
        innovation = track.y[t, (1 - own) * k] * even - one * x[first, k] - other * x[second, k]
        bank.likelihood[k] -= 0.5 * _robust_square(innovation * innovation * bank.inverse[k])
        bank.product[k] *= total
        if own:
            track.out[t, k], track.variance[t, k] = innovation, total
            bank.gained[k] = innovation * bank.inverse[k]
    if not own:
        deviation = np.sqrt(bank.inverse[0])
        for k in range(columns):
            innovation = track.y[t, k] * even - one * x[first, k] - other * x[second, k]
            track.out[t, k], bank.gained[k] = innovation * deviation, innovation * bank.inverse[0]
    for i in range(states):
        for k in range(columns):
            x[i, k] += h[i, own * k] * bank.gained[k]
        for j in range(i + 1):
            for k in range(lanes):  # from a diffuse P, R remains by cancellation: rounding shows in its sixth digit
                square = h[i, k] * h[j, k]
                cov[j, i, k] -= square * bank.inverse[k] if own else square / bank.total[k]
    _mirror(cov)


@_inlined
def _take_logarithm(product: Floats, likelihood: Floats, lanes: int) -> None:
    """-1/2 log of the product of S, which starts anew."""
    for k in range(lanes):
        likelihood[k] -= 0.5 * np.log(product[k])
        product[k] = 1.0


@_inlined
def _longitudinal(
    speed: _Track, acceleration: _Track, ground: _Track, log_start: Floats, segment_start: Floats, rolling: Floats,
    known: Floats, white: Floats, share: Floats, step_s: float, phi: Floats, colour: Floats, sensor: Floats, own: int,
) -> Floats:  # fmt: skip
    """Log-likelihoods (lanes,); innovations go into the tracks."""
    count, columns = len(phi), speed.out.shape[1]
    lanes = columns if own else 1
    bank = _bank(1 + count, columns, own)
    sensor0, sensor1, sensor2 = sensor
    ground_error = 1.0 if count > 4 else 0.0
    for t in range(len(log_start)):
        if log_start[t] > 0.5:
            _start_log(bank, colour, lanes)
        else:
            _predict(bank, step_s * rolling[t], phi, colour, lanes, own)
            if segment_start[t] > 0.5:
                _start_segment(bank)
        if known[t, 0] > 0.0:
            _update(bank, t, speed, white[t, 0], sensor0, 0, 1.0, 4, share[t], lanes, own)
        if known[t, 1] > 0.0:
            _update(bank, t, acceleration, white[t, 1], sensor1, 1, rolling[t], 3, 1.0, lanes, own)
        if known[t, 2] > 0.0:
            _update(bank, t, ground, white[t, 2], sensor2, 0, 1.0, count, ground_error, lanes, own)
        if t % _SAMPLES_PER_LOGARITHM == 0:
            _take_logarithm(bank.product, bank.likelihood, lanes)
    _take_logarithm(bank.product, bank.likelihood, lanes)
    return bank.likelihood


@compiled
def longitudinal_innovations(
    tracks: Three, scale: Floats, log_start: Floats, segment_start: Floats, rolling: Floats, white: Floats,
    share: Floats, step_s: float, phi: Floats, colour: Floats, outs: Three,
) -> float:  # fmt: skip
    """Innovations of the tracks along the road, and the log-likelihood of the first column.

    Parameters
    ----------
    tracks : speed (m/s), acceleration (m/s2), ground speed (m/s), each (samples, columns), divided by ``scale``.
    scale, log_start, segment_start, rolling, share : (samples,); 1 where a log or a segment begins and where the car
        rolls; ``share`` is v / 20 m/s.
    white : (samples, 3) variance of the white noise, 0 where a track is not compared.
    phi, colour : (disturbances, 1) AR(1) coefficient and variance of f, g, a, w and, where there is one, s.
    outs : written, as ``tracks``: innovations of variance 1, 0 where nothing is compared.
    """
    for out in outs:
        out[:] = 0.0
    speed = _Track(tracks[0], scale, outs[0], outs[0])
    acceleration = _Track(tracks[1], scale, outs[1], outs[1])
    ground = _Track(tracks[2], scale, outs[2], outs[2])
    likelihoods = _longitudinal(
        speed, acceleration, ground, log_start, segment_start, rolling, white, white, share, step_s, phi, colour,
        np.zeros((3, 1)), 0,
    )  # fmt: skip
    return float(likelihoods[0])


@compiled
def longitudinal_likelihoods(
    tracks: Three, scale: Floats, log_start: Floats, segment_start: Floats, rolling: Floats, known: Floats,
    white: Floats, share: Floats, step_s: float, phi: Floats, colour: Floats, sensor: Floats, innovations: Floats,
    variances: Floats,
) -> Floats:  # fmt: skip
    """Log-likelihoods, (lanes,), of one column of the tracks along the road by many noises.

    Parameters
    ----------
    tracks ... share : as in `longitudinal_innovations`; ``known`` is 1 where a track is compared.
    phi, colour : (disturbances, lanes).
    sensor : (3, lanes) variance of the white noise beside the shared ``white``.
    innovations, variances : written where a track is compared, (3, samples, lanes): y - H x and S.
    """
    speed = _Track(tracks[0], scale, innovations[0], variances[0])
    acceleration = _Track(tracks[1], scale, innovations[1], variances[1])
    ground = _Track(tracks[2], scale, innovations[2], variances[2])
    return _longitudinal(
        speed, acceleration, ground, log_start, segment_start, rolling, known, white, share, step_s, phi, colour,
        sensor, 1,
    )  # fmt: skip


@_inlined
def _channel(
    track: _Track, log_start: Floats, known: Floats, white: Floats, phi: Floats, colour: Floats, own: int
) -> Floats:
    """Log-likelihoods (lanes,) of a track with one disturbance; innovations go into the track."""
    columns = track.out.shape[1]
    lanes = columns if own else 1
    x, p, innovation = np.zeros(columns), colour.copy(), np.zeros(columns)
    gain, inverse, product, likelihood = np.zeros(lanes), np.zeros(lanes), np.ones(lanes), np.zeros(lanes)
    for t in range(len(log_start)):
        if log_start[t] > 0.5:
            x[:] = 0.0
            p[:] = colour
        else:
            for k in range(columns):
                x[k] *= phi[own * k]
            for k in range(lanes):
                p[k] = phi[k] * phi[k] * p[k] + (1.0 - phi[k] * phi[k]) * colour[k]
        if known[t] > 0.0:
            even = 1.0 / track.scale[t]
            for k in range(lanes):
                total = p[k] + white[t, k]
                inverse[k] = 1.0 / total
                gain[k] = p[k] / total
                p[k] -= gain[k] * p[k]
                product[k] *= total
                if own:
                    track.variance[t, k] = total
            factor = 1.0 if own else np.sqrt(inverse[0])
            for k in range(columns):
                innovation[k] = track.y[t, (1 - own) * k] * even - x[k]
                x[k] += gain[own * k] * innovation[k]
                track.out[t, k] = innovation[k] * factor
            for k in range(lanes):
                likelihood[k] -= 0.5 * _robust_square(innovation[k] * innovation[k] * inverse[k])
        elif not own:
            track.out[t] = 0.0
        if t % _SAMPLES_PER_LOGARITHM == 0:
            _take_logarithm(product, likelihood, lanes)
    _take_logarithm(product, likelihood, lanes)
    return likelihood


@compiled
def channel_innovations(
    y: Floats, scale: Floats, log_start: Floats, white: Floats, phi: float, colour: float, out: Floats
) -> float:
    """Innovations of a track ``y`` (samples, columns) into ``out``, and the log-likelihood of the first column.

    ``phi`` and ``colour`` are AR(1) coefficient and variance; the rest is as in `longitudinal_innovations`.
    """
    track, variance = _Track(y, scale, out, out), white.reshape(-1, 1)
    return float(_channel(track, log_start, white, variance, np.full(1, phi), np.full(1, colour), 0)[0])


@compiled
def channel_likelihoods(
    y: Floats, scale: Floats, log_start: Floats, known: Floats, white: Floats, phi: Floats, colour: Floats,
    innovations: Floats, variances: Floats,
) -> Floats:  # fmt: skip
    """Log-likelihoods, (lanes,), of a track ``y`` (samples, 1) by many noises.

    ``white``, ``innovations`` and ``variances`` are (samples, lanes), ``phi`` and ``colour`` (lanes,); the rest is as
    in `longitudinal_likelihoods`.
    """
    return _channel(_Track(y, scale, innovations, variances), log_start, known, white, phi, colour, 1)

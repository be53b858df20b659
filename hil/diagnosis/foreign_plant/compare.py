"""Measured less simulated, channel by channel: how far, how late, how white, and where it is worst."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hil.diagnosis.data.dataset import SINGLES, SLOW_MPS, Dataset
from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.prepare import STRAIGHT_RAD, TRACK
from hil.diagnosis.noise.estimate import first_guess
from hil.diagnosis.noise.model import SampleMasks
from hil.diagnosis.result.goodness_of_fit import whiteness
from hil.diagnosis.result.residual_patterns import UNITS, variables_of
from hil.diagnosis.result.statistics import pattern

LEAST_SAMPLES = 50
"""Compared samples that a channel needs, and a context to be listed (as `hil.diagnosis.noise.model`)."""
_SWING_S = 0.3  # after the start of a segment, until the body has swung in (as there)
_LONGEST_LAG_S, _MOVES = 0.5, 3.0
"""Lags that are tried, either way, and times its noise that a channel moves for a lag to be seen."""
_WORST_S = 1.0  # length of the stretch that is listed as the worst
_APPLIED_PA, _DRIVES_NM = 2e5, 20.0  # of any wheel: brakes and motors that act
_CORRELATED_S = 0.1  # time between samples that count for a correlation


@dataclass(frozen=True)
class ChannelResidual:
    """One channel.

    Attributes
    ----------
    unit : of rms, bias, noise and contexts; wheel speeds are compared as speeds at the rolling radius.
    rms, bias : of measured less simulated.
    lag_s : by which the measurement comes after the simulation; None where the channel moves too little to tell.
    explained : share of the measured variance, 1 less that of the residual over it; below 0 where none is.
    noise : standard deviation of white noise that the residual shows, the sensor's own.
    over_noise : rms over it; 1 leaves nothing to explain.
    autocorrelation, whiteness_p : of the residual from sample to sample (Ljung and Box 1978).
    worst_log, worst_s, worst_rms : the second with the largest error: its log, from when to when.
    worst_context, contexts : what the car does where the rms is largest; rms of each such context.
    goes_with : what the residual correlates with.
    """

    channel: str
    unit: str
    samples: int
    rms: float
    bias: float
    lag_s: float | None
    explained: float
    noise: float
    over_noise: float
    autocorrelation: float
    whiteness_p: float
    worst_log: str
    worst_s: tuple[float, float]
    worst_rms: float
    worst_context: str
    contexts: Mapping[str, float]
    goes_with: str

    def as_json(self) -> dict[str, Any]:
        """As printed."""
        values = asdict(self)
        values["worst_from_s"], values["worst_to_s"] = values.pop("worst_s")
        return values


@dataclass(frozen=True, eq=False)
class Pair:
    """A channel measured and simulated, (samples,) over all recordings in ``unit``; ``known`` where it is compared."""

    group: str
    unit: str
    measured: Floats
    simulated: Floats
    known: Floats

    @property
    def residual(self) -> Floats:
        """Measured less simulated; NaN where it is not compared."""
        return np.asarray(np.where(self.known, self.measured - self.simulated, np.nan))


def paired(channels: Mapping[str, Floats], dataset: Dataset, radius_m: float) -> dict[str, Pair]:
    """Measured channels beside simulated ones that have enough samples."""
    masks = SampleMasks.of(dataset)
    starts = np.maximum(masks.segment_start, masks.log_start)
    swings = np.convolve(starts, np.ones(int(np.ceil(_SWING_S / dataset.sample_s))))[: len(starts)]
    resting = np.concatenate([one.resting for one in dataset.recordings])
    copied = {name for one in dataset.recordings for name in one.log.copied}
    found = {}
    for channel, simulated in channels.items():
        group = next(group for group, names in TRACK.items() if channel in names)
        column = TRACK[group].index(channel)
        measured = np.concatenate([one.measured[group][:, column] for one in dataset.recordings])
        within = masks.moving > 0.5
        if group in SINGLES and group != "gps":
            within = within | (resting > 0.5)
        elif group in ("pressure", "motor"):
            within = np.ones(len(measured), bool)
        known = within & np.isfinite(measured) & np.isfinite(simulated)
        known &= (swings if group in ("ax", "ay", "yaw") else starts) < 0.5
        if channel not in copied and int(known.sum()) >= LEAST_SAMPLES:
            factor = radius_m if group == "wheel" else 1.0
            found[channel] = Pair(group, UNITS[group], factor * measured, factor * simulated, known)
    return found


def compare(pairs: Mapping[str, Pair], dataset: Dataset) -> list[ChannelResidual]:
    """Every channel, the one farthest beyond its noise first."""
    masks = SampleMasks.of(dataset)
    names = {
        channel: f"{pair.group}.{channel}" for channel, pair in pairs.items()
    }  # each by itself, none along the road
    masks = replace(
        masks, names=tuple(names.values()), jitter_variance={},
        present={names[channel]: pair.known * 1.0 for channel, pair in pairs.items()},
    )  # fmt: skip
    tracks = {names[channel]: np.nan_to_num(pair.residual)[:, None] for channel, pair in pairs.items()}
    # by second differences: an FMU that drifts away would have the full estimate take its error for noise, or none
    noise = first_guess(tracks, masks).tracks
    contexts, variables = _contexts(dataset), variables_of(dataset)
    found = [
        _channel(channel, pair, masks, noise[names[channel]].a, contexts, variables, dataset)
        for channel, pair in pairs.items()
    ]
    return sorted(found, key=lambda one: -one.over_noise)


def _channel(
    channel: str, pair: Pair, masks: SampleMasks, white: float, contexts: Mapping[str, Floats],
    variables: dict[str, Floats], dataset: Dataset,
) -> ChannelResidual:  # fmt: skip
    known, residual = pair.known, pair.residual
    errors = residual[known]
    rms, spread = _rms(errors), float(np.std(pair.measured[known]))
    rho, p = whiteness(errors)
    by_context = {
        name: _rms(residual[known & at]) for name, at in contexts.items() if int((known & at).sum()) >= LEAST_SAMPLES
    }
    log, begin_s, worst = _worst(residual, dataset)
    worst_context = max(by_context, key=lambda name: by_context[name], default="")
    moves = float(np.std(pair.simulated[known])) > _MOVES * white
    return ChannelResidual(
        channel, pair.unit, int(known.sum()), rms, float(errors.mean()), _lag_s(pair, masks) if moves else None,
        1.0 - float(np.var(errors)) / max(spread**2, 1e-24), white, rms / white, rho, p, log,
        (begin_s, begin_s + _WORST_S), worst, worst_context, by_context,
        pattern(residual, known, variables, max(round(_CORRELATED_S / dataset.sample_s), 1)),
    )  # fmt: skip


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _lag_s(pair: Pair, masks: SampleMasks) -> float | None:
    """Delay of the simulation with which least variance is left, s, by a parabola; None beyond the longest."""
    most = round(_LONGEST_LAG_S / masks.sample_s)
    segment, left = masks.segment_id, []
    for shift in range(-most, most + 1):
        now = slice(max(shift, 0), len(segment) + min(shift, 0))
        then = slice(max(-shift, 0), len(segment) + min(-shift, 0))
        both = pair.known[now] & pair.known[then] & (segment[now] == segment[then])
        left.append(float(np.var((pair.measured[now] - pair.simulated[then])[both])) if both.any() else np.inf)
    best = int(np.argmin(left))
    if best in (0, 2 * most):
        return None
    before, at, after = left[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    return float((best - most + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) * masks.sample_s)


def _worst(residual: Floats, dataset: Dataset) -> tuple[str, float, float]:
    """Log, start (s in it) and rms of the second with the largest error."""
    window, first = max(round(_WORST_S / dataset.sample_s), 1), 0
    worst = ("", 0.0, 0.0)
    for recording in dataset.recordings:
        here = residual[first : first + recording.samples]
        first += recording.samples
        known = np.isfinite(here)
        squares, counts = (
            np.convolve(values, np.ones(window), "valid") for values in (np.nan_to_num(here) ** 2, known * 1.0)
        )
        mean = np.where(counts > 0.5 * window, squares / np.maximum(counts, 1.0), 0.0)
        at = int(np.argmax(mean))
        if (rms := float(np.sqrt(mean[at]))) > worst[2]:
            worst = (recording.log.name, float(recording.log.t_s[0]) + at * dataset.sample_s, rms)
    return worst


def _contexts(dataset: Dataset) -> dict[str, Floats]:
    """What the car does, (samples,) true or false by its words."""
    variables = variables_of(dataset)
    fast, brakes = variables["speed"] > SLOW_MPS, variables["pressure"] > _APPLIED_PA
    motor, turns = variables["motor torque"], np.abs(variables["steering"]) > STRAIGHT_RAD
    pushes, holds = motor > _DRIVES_NM, motor < -_DRIVES_NM
    does = {
        "braking by friction": brakes & ~holds, "braking by friction and motors": brakes & holds,
        "braking by motors": ~brakes & holds, "driven": ~brakes & pushes, "rolling": ~brakes & ~holds & ~pushes,
    }  # fmt: skip
    found = {f"below {SLOW_MPS:g} m/s": ~fast}
    for words, at in does.items():
        found[words] = fast & at & ~turns
        found[f"{words}, steered"] = fast & at & turns
    return found

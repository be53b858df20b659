"""Stamps: what comes too late behind the others, and which of the channels it is."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.data.log import MOTOR_TORQUE, PRESSURE, WHEEL_SPEED, Floats, Log
from hil.diagnosis.data.trial.agreement import agreement
from hil.diagnosis.data.trial.finding import Finding
from hil.diagnosis.data.trial.forces import force_parts
from hil.diagnosis.data.trial.lateral import turning
from hil.diagnosis.data.trial.motion import Motion, spread

FITTED_S = 0.25
"""Lateness that the diagnosis may fit as a parameter; beyond, a channel is moved or refused."""
_ALIKE_S = 0.15
"""Largest difference in lag between channels that agree: filters, bus cycles, slip of the tyres as the brake rises."""
_STRONG, _STRONG_FORCE = 0.93, 0.9
_BETTER = 0.03
"""Least rise of the correlation by the lag: manoeuvres that repeat go with themselves at other lags, too."""
_SAME = 1.25
"""Factor within which two accelerations are the same one but late: a slow filter makes its own smaller as well."""
_LEAST_MPS2, _LEAST_RAD_S = 0.25, 0.01
_IMU = ("ax_mps2", "ay_mps2", "yaw_rate_rad_s")
_NODES: Mapping[str, tuple[str, ...]] = {
    "wheels": WHEEL_SPEED, "ground": ("speed_mps",), "ax": _IMU, "pressure": PRESSURE, "motor": MOTOR_TORQUE,
}  # fmt: skip
"""Source -> channels that have its stamps."""
_TITLE = {
    "wheels": "the wheel speeds", "ground": "speed_mps", "ax": "ax_mps2", "pressure": "the pressures",
    "motor": "the motor torques",
}  # fmt: skip


@dataclass(frozen=True)
class Stamps:
    """Lateness of each source behind the wheel speeds (else the ground speed), s, and by channel for the table."""

    sources: Mapping[str, float]
    channels: Mapping[str, float]


def stamps(motion: Motion) -> Stamps:
    """Lags that a log shows clearly."""
    reference = "wheels" if "wheels" in motion.along else "ground"
    if reference not in motion.along:
        return Stamps({}, {})
    base = motion.along[reference]
    sources: dict[str, float] = {}
    if spread(base) > _LEAST_MPS2:
        for name in ("ground", "ax"):
            if name in motion.along and name != reference:
                lag = _lag(base, motion.along[name], _STRONG, scaled=True)
                sources |= {} if lag is None else {name: lag}
        for name, (rest, part) in force_parts(motion).items():
            lag = _lag(rest, part, _STRONG_FORCE, scaled=False)
            sources |= {} if lag is None else {name: lag}
    if sources:
        sources[reference] = 0.0
    channels = {channel: lag for source, lag in sources.items() for channel in _channels(motion, source)}
    shown = turning(motion)
    for name, channel in (("yaw", "yaw_rate_rad_s"), ("ay", "ay_mps2")):
        channels.pop(channel, None)
        if name in shown and "wheels" in shown and spread(shown["wheels"]) > _LEAST_RAD_S:
            lag = _lag(shown["wheels"], shown[name], _STRONG, scaled=True)
            channels |= {} if lag is None else {channel: lag}
    return Stamps(sources, channels)


def _channels(motion: Motion, source: str) -> list[str]:
    return [name for name in _NODES[source] if name in motion.raw]


def _lag(x: Floats, y: Floats, strong: float, scaled: bool) -> float | None:
    """Lateness of y behind x, s; None where they do not go together clearly enough."""
    seen = agreement(x, y)
    if seen.correlation < strong or (scaled and not 1.0 / _SAME < seen.factor < _SAME):
        return None
    if abs(seen.lag_s) > FITTED_S and seen.correlation - agreement(x, y, 0.0).correlation < _BETTER:
        return None
    return float(seen.lag_s)


def late(motion: Motion, seen: Stamps) -> tuple[str, float] | Finding | None:
    """The one source that all others contradict, with its lateness; a finding where two stand against each other.

    None where all lie within what the diagnosis fits.
    """
    lags = dict(seen.sources)
    if len(lags) < 2 or max(lags.values()) - min(lags.values()) <= FITTED_S:
        return None
    for name, lag in lags.items():
        others = [value for other, value in lags.items() if other != name]
        middle = float(np.mean(others))
        if len(others) > 1 and max(others) - min(others) <= _ALIKE_S and abs(lag - middle) > FITTED_S:
            return name, lag - middle
    (first, early), (last, after) = min(lags.items(), key=lambda item: item[1]), max(lags.items(), key=lambda i: i[1])
    channels = tuple(_channels(motion, last) + _channels(motion, first))
    return Finding(
        channels,
        f"{_TITLE[last]} are {after - early:.2f} s later than {_TITLE[first]}; expected {FITTED_S:g} s at most",
        "nothing else shows which of both has wrong stamps: leave one of them out of the table or the --map, or mend "
        "its stamps",
        names_itself=True,
    )


def moved(log: Log, motion: Motion, source: str, late_s: float, seen: Stamps) -> Log:
    """The log with the channels of a source moved by its lateness, and a remark on how it was seen.

    Samples go to the row nearest to their new stamp; none is made up.
    """
    channels = dict(log.channels)
    names = [name for name in _channels(motion, source) if name in channels]
    for name in names:
        channels[name] = _earlier(log.t_s, channels[name], late_s)
    agree = [_TITLE[other] for other in seen.sources if other != source]
    remark = (
        f"{', '.join(names)} {'are' if len(names) > 1 else 'is'} {abs(late_s):.2f} s "
        f"{'late' if late_s > 0.0 else 'early'} beside {' and '.join(agree)}, which agree: moved by that time, more "
        "than a lateness to estimate; mend the stamps of this message"
    )
    return replace(log, channels=channels, remarks=(*log.remarks, remark))


def _earlier(t_s: Floats, values: Floats, by_s: float) -> Floats:
    """Values (n,) at the rows nearest to ``by_s`` before their own, NaN where none is."""
    finite = np.isfinite(values)
    own = t_s[finite] - by_s
    dense = finite.mean() > 0.5
    if dense:  # every row has a value: the one that is nearest in time
        at = np.clip(np.searchsorted(own, t_s), 1, len(own) - 1)
        at -= (t_s - own[at - 1]) < (own[at] - t_s)
        step = float(np.median(np.diff(t_s)))
        return np.where(np.abs(own[at] - t_s) <= 0.6 * step, values[finite][at], np.nan)
    out = np.full(len(values), np.nan)
    at = np.clip(np.searchsorted(t_s, own), 1, len(t_s) - 1)
    at -= (own - t_s[at - 1]) < (t_s[at] - own)
    inside = (own >= t_s[0]) & (own <= t_s[-1])
    out[at[inside]] = values[finite][inside]
    return out

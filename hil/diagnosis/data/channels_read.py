"""What was read of each channel: where it came from, its unit, its rate before any gridding, and what is missing."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from hil.diagnosis.data.log import Floats, Log

GAP_S = 0.25
"""Time between two samples from which on a channel has a gap: nothing is interpolated over it."""
_SUFFIXES = {
    "_rad_s": "rad/s", "_mps2": "m/s2", "_mps": "m/s", "_pa": "Pa", "_nm": "N m", "_rad": "rad",
}  # fmt: skip


def si_unit(channel: str) -> str:
    """Unit of a channel of the canonical table; empty for shares."""
    return next((unit for suffix, unit in _SUFFIXES.items() if channel.endswith(suffix)), "")


@dataclass(frozen=True)
class ChannelRead:
    """One channel of one file, as read.

    Attributes
    ----------
    channel, column : name in the canonical table, and of the column or signal that it was made of.
    unit : the one that the values of the column were taken in.
    rate_hz : median rate of the samples as they came; None with fewer than two.
    samples, gaps : samples with a value; intervals of more than 0.25 s without one.
    nan_share : share of the samples without a value, 0 to 1.
    least, greatest : range, SI; None without a value.
    lag_s : lateness behind the wheel speeds that the log shows (`hil.diagnosis.data.trial`); None where it shows none.
    """

    channel: str
    column: str
    unit: str
    rate_hz: float | None
    samples: int
    gaps: int
    nan_share: float
    least: float | None
    greatest: float | None
    lag_s: float | None = None


def channel_read(channel: str, column: str, unit: str, t_s: "Floats", values: "Floats") -> ChannelRead:
    """Account of a channel, by its own stamps ``t_s`` (n,), s, and values (n,), SI."""
    finite = np.isfinite(values)
    steps = np.diff(t_s[finite])
    some = values[finite]
    return ChannelRead(
        channel, column, unit or si_unit(channel) or "1",
        rate_hz=float(1.0 / np.median(steps)) if len(steps) and np.median(steps) > 0.0 else None,
        samples=len(some), gaps=int((steps > GAP_S).sum()),
        nan_share=float(1.0 - finite.mean()) if len(finite) else 1.0,
        least=float(some.min()) if len(some) else None, greatest=float(some.max()) if len(some) else None,
    )  # fmt: skip


def channels_read(logs: Iterable["Log"]) -> list[dict[str, Any]]:
    """One row a file and channel, for the answer: numbers, and null where there is none."""
    return [
        {
            "log": log.name, "channel": one.channel, "column": one.column, "unit": one.unit, "rate_hz": one.rate_hz,
            "samples": one.samples, "gaps": one.gaps, "nan_share": one.nan_share, "least": one.least,
            "greatest": one.greatest, "lag_s": one.lag_s,
        }
        for log in logs
        for one in log.read
    ]  # fmt: skip

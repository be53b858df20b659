"""The canonical table of a log: SI channels over one time base, and the checks it has to pass."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.channels_read import ChannelRead, channel_read
from hil.diagnosis.data.hints import expected_instead, unit_hint
from hil.errors import BrakebenchError

Floats = NDArray[Any]  # float64 unless a docstring says otherwise
WHEELS = ("fl", "fr", "rl", "rr")


def four(stem: str, unit: str) -> tuple[str, ...]:
    """Names of a quantity's channels at the four wheels."""
    return tuple(f"{stem}_{wheel}_{unit}" for wheel in WHEELS)


WHEEL_SPEED = four("wheel_speed", "rad_s")
PRESSURE = four("pressure", "pa")
PRESSURE_DEMAND = four("pressure_demand", "pa")
MOTOR_TORQUE = four("motor_torque", "nm")
MOTOR_DEMAND = four("motor_torque_demand", "nm")
SINGLE = ("ax_mps2", "ay_mps2", "yaw_rate_rad_s", "steer_rad", "pedal", "throttle", "soc", "speed_mps")
CHANNELS = (*WHEEL_SPEED, *PRESSURE, *PRESSURE_DEMAND, *MOTOR_TORQUE, *MOTOR_DEMAND, *SINGLE)
"""All channels of a table besides ``t_s``; each is optional."""

_PLAUSIBLE = {
    "wheel_speed": (-400.0, 400.0),
    "pressure": (-2e6, 4e7),
    "motor_torque": (-5000.0, 5000.0),
    "ax": (-40.0, 40.0),
    "ay": (-40.0, 40.0),
    "yaw_rate": (-5.0, 5.0),
    "steer": (-20.0, 20.0),
    "pedal": (-0.2, 1.2),
    "throttle": (-0.2, 1.2),
    "soc": (-0.05, 1.05),
    "speed": (-10.0, 120.0),
}
"""Stem of a channel's name -> range of values a car can have, SI."""
_SHORTEST_S, _SLOWEST_HZ = 2.0, 5.0


class UnusableError(BrakebenchError):
    """Measured data or an input file that cannot be used; the message says why."""


@dataclass(frozen=True, eq=False)
class Log:
    """One recording.

    Attributes
    ----------
    name : of its file.
    t_s : (n,) strictly increasing, s.
    channels : name of `CHANNELS` -> (n,) values, SI; NaN where missing.
    direction : +1 or -1 along the road.
    disc_temperature_k : at the start, K; None if unknown.
    remarks : what was done to the data, for the report.
    columns : names of all columns or signals of the file, used or not.
    read : what was read of each channel.
    another_car : whether it is a file that is no recording of our own bus.
    copied : channels that are another wheel's (`hil.diagnosis.data.paired_wheels`), not measured ones.
    """

    name: str
    t_s: Floats
    channels: Mapping[str, Floats]
    direction: int = 1
    disc_temperature_k: float | None = None
    remarks: tuple[str, ...] = field(default=())
    columns: tuple[str, ...] = ()
    read: tuple[ChannelRead, ...] = ()
    another_car: bool = False
    copied: frozenset[str] = frozenset()

    def has(self, *names: str) -> bool:
        """Whether the log has all these channels."""
        return all(name in self.channels for name in names)


@dataclass(frozen=True, eq=False)
class Origin:
    """Where a channel came from: its column or signal, the unit taken, and its own stamps and values if it has any.

    ``t_s`` (n,), s, and ``values`` (n,), SI, are as they came, before they were put on the stamps of the log.
    """

    column: str
    unit: str = ""
    t_s: Floats | None = None
    values: Floats | None = None


def make_log(
    name: str, t_s: Floats, channels: Mapping[str, Floats], remarks: tuple[str, ...] = (),
    origins: Mapping[str, Origin] | None = None, columns: Sequence[str] = (),
) -> Log:  # fmt: skip
    """A checked log: unknown columns, repeated times and implausible values are left out, with a remark.

    Parameters
    ----------
    origins : by channel; None where the channels are the columns.
    columns : names of all columns that were seen; empty where the channels are all.

    Raises
    ------
    UnusableError
        No known channel; times not finite or decreasing; too short or too slow; more than 1 % implausible values.
    """
    t_s = np.asarray(t_s, np.float64)
    known = {key: np.asarray(value, np.float64) for key, value in channels.items() if key in CHANNELS}
    notes = list(remarks)
    columns = tuple(columns) or tuple(channels)
    unknown = sorted(set(channels) - set(known))
    if unknown:
        notes.append(f"unknown columns are left out: {', '.join(unknown[:12])}")
    accounts = [_account(key, value, t_s, (origins or {}).get(key)) for key, value in known.items()]
    notes += [f"{one.channel} (column {one.column}) has no value at all" for one in accounts if not one.samples]
    known = {key: value for key, value in known.items() if np.isfinite(value).any()}
    if not known:
        raise UnusableError(f"{name}: no channel with values; {expected_instead(columns, CHANNELS)}")
    if not np.isfinite(t_s).all():
        raise UnusableError(f"{name}: {int((~np.isfinite(t_s)).sum())} values of t_s are not finite")
    t_s, known = _increasing(name, t_s, known, notes)
    known = {key: _plausible(name, key, value, notes) for key, value in known.items()}
    return Log(name, t_s, known, remarks=tuple(notes), columns=columns, read=tuple(accounts))


def _account(channel: str, values: Floats, t_s: Floats, origin: Origin | None) -> ChannelRead:
    if origin is None:
        return channel_read(channel, channel, "", t_s, values)
    if origin.t_s is not None and origin.values is not None:
        t_s, values = origin.t_s, origin.values
    return channel_read(channel, origin.column, origin.unit, t_s, values)


def _increasing(
    name: str, t_s: Floats, known: dict[str, Floats], notes: list[str]
) -> tuple[Floats, dict[str, Floats]]:  # fmt: skip
    """Times that increase, with the channels at them; ``notes`` tell of rows left out."""
    steps = np.diff(t_s)
    if len(steps) and (steps < 0.0).any():
        at = int(np.argmax(steps < 0.0))
        raise UnusableError(f"{name}: the clock runs backwards at row {at + 1} ({t_s[at]:g} to {t_s[at + 1]:g} s)")
    if len(steps) and (steps == 0.0).any():
        keep = np.concatenate((steps > 0.0, [True]))
        notes.append(f"{int((~keep).sum())} rows with a repeated time are left out")
        t_s, known = t_s[keep], {key: value[keep] for key, value in known.items()}
    length_s = float(t_s[-1] - t_s[0]) if len(t_s) > 1 else 0.0
    cycle_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    if length_s + 1.5 * cycle_s < _SHORTEST_S:  # 200 samples at 100 Hz are 2 s
        raise UnusableError(
            f"{name}: {length_s:.2f} s long; expected {_SHORTEST_S:g} s or more (is t_s in seconds?); leave it out, or "
            "record from before the manoeuvre to after it"
        )
    if len(t_s) / length_s < _SLOWEST_HZ:
        raise UnusableError(f"{name}: {len(t_s) / length_s:.2f} samples a second; expected {_SLOWEST_HZ:g} or more")
    return t_s, known


def _plausible(name: str, key: str, value: Floats, notes: list[str]) -> Floats:
    """Values of a channel without the implausible ones; ``notes`` tell of them."""
    low, high = next(limits for stem, limits in _PLAUSIBLE.items() if key.startswith(stem))
    outside = (value < low) | (value > high)
    if outside.mean() > 0.01:
        raise UnusableError(
            f"{name}: {key} goes from {np.nanmin(value):g} to {np.nanmax(value):g}; expected {low:g} to {high:g}: "
            f"wrong unit? {unit_hint(key, value, low, high)}"
        )
    if outside.any():
        value = value.copy()
        value[outside] = np.nan
        notes.append(f"{int(outside.sum())} implausible values of {key} are left out")
    return value

"""Quantities that several channels show, on one grid and through one filter: they may be compared as they are."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import savgol_filter

from hil.diagnosis.data.channels_read import GAP_S
from hil.diagnosis.data.grid import without_gaps
from hil.diagnosis.data.log import WHEEL_SPEED, Floats, Log

STEP_S = 0.02
WINDOW = 21
"""Samples of the straight line whose slope is taken: 0.4 s, longer than a wheel oscillates, shorter than a braking."""


@dataclass(frozen=True, eq=False)
class Car:
    """Numbers of the vehicle that the comparison needs: radius, m; mass, kg; track, m; and the gain of the brakes.

    ``brake_gain_nm_pa`` (4,) is a wheel's torque per pressure; ``steering_m`` the steering ratio times the wheelbase.
    """

    radius_m: float
    mass_kg: float
    track_m: float
    brake_gain_nm_pa: Floats
    steering_m: float


@dataclass(frozen=True, eq=False)
class Motion:
    """One log on a grid of 20 ms; all values (rows,), NaN where missing.

    Attributes
    ----------
    raw : channel -> values, SI.
    wheels_mps, ground_mps : speeds by the median wheel at the stated radius, and over ground; empty without.
    along : ``wheels``, ``ground``, ``ax`` -> acceleration along the car, m/s2, all through the same filter.
    """

    log: Log
    car: Car
    t_s: Floats
    raw: Mapping[str, Floats]
    wheels_mps: Floats
    ground_mps: Floats
    along: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def speed_mps(self) -> Floats:
        """By the wheels, else over ground."""
        return self.wheels_mps if len(self.wheels_mps) else self.ground_mps

    @property
    def fast(self) -> "np.typing.NDArray[np.bool_]":
        """Rows above a fifth of the highest speed, whatever its unit: slower, sensors with teeth drop out."""
        speed = np.abs(self.speed_mps)
        known = speed[np.isfinite(speed)]
        return speed > 0.2 * (np.percentile(known, 95.0) if len(known) else 0.0)


def motion_of(log: Log, car: Car) -> Motion:
    """A log on the grid."""
    t_s = np.arange(float(log.t_s[0]), float(log.t_s[-1]), STEP_S)
    raw = {name: _on_grid(log, name, t_s) for name in log.channels if name not in log.copied}
    wheels = [raw[name] * car.radius_m for name in WHEEL_SPEED if name in raw]
    median = _median(np.array(wheels)) if wheels else np.empty(0)
    ground = raw.get("speed_mps", np.empty(0))
    along = {name: slope(speed) for name, speed in (("wheels", median), ("ground", ground)) if len(speed)}
    if "ax_mps2" in raw:
        along["ax"] = filtered(raw["ax_mps2"])
    return Motion(log, car, t_s, raw, median, ground, along)


def _median(values: Floats) -> Floats:
    known = np.isfinite(values).all(axis=0)
    middle = np.full(values.shape[1], np.nan)
    middle[known] = np.median(values[:, known], axis=0)
    return middle


def _on_grid(log: Log, name: str, t_s: Floats) -> Floats:
    """A channel at the times ``t_s``; NaN over gaps."""
    values = log.channels[name]
    finite = np.isfinite(values)
    own_s = log.t_s[finite]
    if len(own_s) < 2:
        return np.full(len(t_s), np.nan)
    out = np.interp(t_s, own_s, values[finite], left=np.nan, right=np.nan)
    steps = np.diff(own_s)
    longest = max(GAP_S, 1.5 * float(np.median(steps)))
    if steps.max() > longest:
        out[steps[np.clip(np.searchsorted(own_s, t_s) - 1, 0, len(steps) - 1)] > longest] = np.nan
    return out


def slope(values: Floats) -> Floats:
    """Slope (rows,), per s, of the straight line through 0.4 s around each row; NaN within that of a gap."""
    if len(values) < WINDOW or not np.isfinite(values).any():
        return np.full(len(values), np.nan)
    out = np.asarray(savgol_filter(without_gaps(values), WINDOW, 1, deriv=1, delta=STEP_S), np.float64)
    gap = ~np.isfinite(values)
    if gap.any():
        out[np.convolve(gap, np.ones(WINDOW), mode="same") > 0.5] = np.nan
    return out


def filtered(values: Floats) -> Floats:
    """Values (rows,) through the filter that `slope` applies to a derivative: the slope of their integral."""
    integral = np.cumsum(without_gaps(values)) * STEP_S
    return slope(np.where(np.isfinite(values), integral, np.nan))


def spread(values: Floats) -> float:
    """Standard deviation of the known values; 0 where there is none."""
    known = values[np.isfinite(values)]
    return float(np.std(known)) if len(known) else 0.0

"""Coast-downs in logs of a speed alone: runs in which nothing but the road load slows the car, as cell means."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, WHEEL_SPEED, Floats, Log
from hil.diagnosis.manoeuvres.stops import speed_of
from hil.diagnosis.vehicle.spec import Vehicle

GRAVITY_MPS2 = 9.80665
CELL_S = 0.5
"""Speeds are averaged over so long: the road load changes within tens of seconds."""
LEAST_MPS, _LEAST_S, _LEAST_FALL_MPS = 15.0 / 3.6, 10.0, 3.0
"""Speed down to which a coast-down is used (ISO 10521-1 goes down to 15 km/h), and its least length and loss."""
_SHARES = (0.2, 3.0)
"""Deceleration of a car that coasts, as shares of the stated road load: less is pulled, more is braked."""
_HALF_SLOPE_CELLS, _MARGIN_S = 3, 2.0
"""Half the window of the slope, and the time near its ends that a run does without: a pedal is still being released."""
_PEDAL = 0.02
_MOST_OF_IT = 0.5
"""Share of the driven time that is a coast-down, from which on logs without forces are coast-downs."""


@dataclass(frozen=True, eq=False)
class RoadLoad:
    """Deceleration by the road load, f = f0 + f2 v^2, per effective mass.

    Attributes
    ----------
    a_mps2, b_1_m : f0 and f2 over the effective mass.
    effective_kg : mass and rotating inertia over the rolling radius squared.
    """

    a_mps2: float
    b_1_m: float
    effective_kg: float


@dataclass(frozen=True, eq=False)
class Run:
    """One coast-down.

    Attributes
    ----------
    log : name.  begin_s : time of the log.  direction : +1 or -1 along the road.
    speed_mps : (cells,) mean over each `CELL_S`, NaN where unknown.
    """

    log: str
    begin_s: float
    direction: int
    speed_mps: Floats

    @property
    def length_s(self) -> float:
        """How long it lasts."""
        return len(self.speed_mps) * CELL_S


def stated_road_load(vehicle: Vehicle) -> RoadLoad:
    """The road load as the vehicle set states it: rolling resistance under the load less lift, and drag."""
    car, wheel = vehicle.parameters.vehicle, vehicle.parameters.wheel
    effective = car.mass_kg + 2.0 * sum(wheel.inertia_kg_m2) / wheel.rolling_radius_m**2
    weight, air = car.mass_kg * GRAVITY_MPS2, 0.5 * car.air_density_kg_m3 * car.frontal_area_m2
    f2 = air * (car.drag_coefficient - car.rolling_resistance * sum(car.lift_coefficient))
    f2 += car.rolling_resistance_speed_s2_m2 * weight
    return RoadLoad(car.rolling_resistance * weight / effective, f2 / effective, effective)


def coast_downs(logs: Sequence[Log], vehicle: Vehicle) -> list[Run]:
    """The coast-downs of logs without measured forces; empty where forces are measured or the car hardly coasts."""
    forces = {*PRESSURE, *PRESSURE_DEMAND, *MOTOR_TORQUE, *MOTOR_DEMAND}
    if any(forces & log.channels.keys() for log in logs):
        return []
    radius, stated = vehicle.parameters.wheel.rolling_radius_m, stated_road_load(vehicle)
    if not all("speed_mps" in log.channels or {*WHEEL_SPEED} & log.channels.keys() for log in logs):
        return []
    runs, driven_s = [], 0.0
    for log in logs:
        own, own_s = _runs(log, radius, stated)
        runs += own
        driven_s += own_s
    return runs if sum(run.length_s for run in runs) >= _MOST_OF_IT * driven_s else []


def _runs(log: Log, radius_m: float, stated: RoadLoad) -> tuple[list[Run], float]:
    """Coast-downs of a log, and the time for which it drives fast enough for one."""
    raw, _ = speed_of(log, radius_m)
    at = ((log.t_s - log.t_s[0]) / CELL_S + 1e-6).astype(np.int64)
    speed, released = _means(np.abs(raw), at), np.ones(int(at[-1]) + 1, bool)
    for name in ("throttle", "pedal"):
        if name in log.channels:
            released &= ~(_means(np.abs(log.channels[name]), at) > _PEDAL)
    slope = _slope(speed)
    load = stated.a_mps2 + stated.b_1_m * speed**2
    fast = speed > LEAST_MPS
    coasts = fast & released & (-slope > _SHARES[0] * load) & (-slope < _SHARES[1] * load)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], coasts.astype(np.int64), [0]))))
    margin, runs = round(_MARGIN_S / CELL_S), []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        begin = first + (margin if first > 0 else 0)
        last = end - (margin if end < len(speed) and speed[min(end, len(speed) - 1)] > LEAST_MPS else 0)
        values = speed[begin:last]
        if (last - begin) * CELL_S >= _LEAST_S and values[0] - values[-1] >= _LEAST_FALL_MPS:
            runs.append(Run(log.name, float(log.t_s[0]) + begin * CELL_S, log.direction, values))
    return runs, float(fast.sum()) * CELL_S


def _means(values: Floats, at: Floats) -> Floats:
    """Mean of each cell; NaN where it has no value. The last cell, which may be cut, is left empty if it is half."""
    good, count = np.isfinite(values), int(at[-1]) + 1
    weight = np.bincount(at[good], minlength=count)
    total = np.bincount(at[good], values[good], minlength=count)
    return np.where(weight > 0.6 * np.median(weight), total / np.maximum(weight, 1), np.nan)


def _slope(speed: Floats) -> Floats:
    """Slope of the line through the cells around each one, m/s2; NaN where fewer than three are known."""
    slope = np.full(len(speed), np.nan)
    for k in range(len(speed)):
        first = max(k - _HALF_SLOPE_CELLS, 0)
        window = speed[first : k + _HALF_SLOPE_CELLS + 1]
        good = np.flatnonzero(np.isfinite(window))
        if len(good) > 2:
            slope[k] = np.polyfit(CELL_S * good, window[good], 1)[0]
    return slope

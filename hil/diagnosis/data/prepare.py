"""Logs into the dataset: inputs of the simulation on the 10 ms grid, segments, measured tracks and masks."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hil.diagnosis.data.clock import clock_origin_s, timestamp_jitter_s
from hil.diagnosis.data.dataset import ROW_S, SLOW_MPS, Dataset, Recording, Segment
from hil.diagnosis.data.grid import averaged, has_sample, resampled, smoothed, without_gaps
from hil.diagnosis.data.hints import nothing_shows_force, nothing_shows_speed
from hil.diagnosis.data.log import (
    MOTOR_DEMAND,
    MOTOR_TORQUE,
    PRESSURE,
    PRESSURE_DEMAND,
    WHEEL_SPEED,
    Floats,
    Log,
    UnusableError,
)
from hil.diagnosis.data.masks import SETTLE_S, Mask, after_wheel_lock, known_pressures, moving_and_resting
from hil.diagnosis.data.paired_wheels import copied_axles
from plant.vectors import CUT, INPUT, U

STRAIGHT_RAD = 0.02  # of the steering wheel
_SHORTEST_S, _LONGEST_S, _TURNING_S = 8.0, 25.0, 3.0
"""Length of a segment: at least, unless it stops or turns; at most; and while the car turns."""
_RELEASED_PA, _RELEASED_NM = 1e5, 20.0
_CONTRADICTED = 0.8
"""Share of the time with active brakes or motors that has no demand, beyond which the demands are dropped."""
_UNDEMANDED_S, _RELEASE_S = 0.5, 0.5
"""Least time without a demand that contradicts one, and how long after a demand a release may take, s."""
_STATE_OF_CHARGE = 0.7  # where no log has it
_LEAST_MOVING_S = 4.0
TRACK = {
    "wheel": WHEEL_SPEED, "pressure": PRESSURE, "motor": MOTOR_TORQUE,
    "ax": ("ax_mps2",), "ay": ("ay_mps2",), "yaw": ("yaw_rate_rad_s",), "gps": ("speed_mps",),
}  # fmt: skip
_FILTERED, _FILTER_S = ("ax", "ay", "yaw"), 0.2
"""Tracks whose simulated sensor starts without the past of its filter, and the time for which that shows."""


def prepare(logs: Sequence[Log], radius_m: float, unstated: Collection[str] = ()) -> Dataset:
    """The dataset of some logs, for wheels of radius ``radius_m``, m.

    The simulation cannot follow the demands of sections that are ``unstated`` in the vehicle set: torques of such
    motors are not compared; pressures only where their demand is zero, or left with right where the demands are equal.

    Raises
    ------
    UnusableError
        No measured speed, no measured or demanded force, or the car hardly moves.
    """
    if "motor" in unstated and all(log.has(*MOTOR_TORQUE) for log in logs):
        logs = _without(logs, set(MOTOR_DEMAND))
    logs = _without_contradicted_demands(logs)
    common = set.intersection(*(set(log.channels) for log in logs))
    if not (set(WHEEL_SPEED) & common or "speed_mps" in common):
        raise UnusableError(nothing_shows_speed(logs))
    pressure, pressure_demand, torque, torque_demand = (
        set(names) <= common for names in (PRESSURE, PRESSURE_DEMAND, MOTOR_TORQUE, MOTOR_DEMAND)
    )
    if not (pressure or pressure_demand or torque or torque_demand):
        raise UnusableError(nothing_shows_force(logs))
    mask = CUT.zeros()
    mask[CUT.slice("pressure")] = 1.0 if pressure else 0.0
    mask[CUT.slice("motor_torque")] = 1.0 if torque else 0.0
    mask[CUT.slice("motor_speed")] = 1.0 if set(WHEEL_SPEED) <= common else 0.0
    groups = [name for name, names in TRACK.items() if set(names) <= common]
    if "wheel" not in groups and set(WHEEL_SPEED) & common:
        groups.insert(0, "wheel")  # some wheels only: the others are empty
    for name, demand in (("pressure", pressure_demand), ("motor", torque_demand)):
        if name in groups and not demand:
            groups.remove(name)  # without a demand it is not simulated
    cycle_s = max(float(np.median(np.diff(log.t_s))) for log in logs)
    stride = max(2, int(np.ceil(cycle_s / ROW_S - 0.2)))
    tracked = ("motor",) if "ehb" in unstated else ("pressure", "motor")
    recordings = tuple(
        replace(_recording(log, groups, stride, radius_m, tracked), number=k) for k, log in enumerate(logs)
    )
    moving_s = sum(float(recording.moving.sum()) for recording in recordings) * stride * ROW_S
    if round(moving_s, 1) < _LEAST_MOVING_S:
        raise UnusableError(
            f"the car moves for {moving_s:.1f} s in all logs; expected {_LEAST_MOVING_S:g} s or more above "
            f"{SLOW_MPS:g} m/s; add logs of more such manoeuvres, or longer ones"
        )
    return Dataset(recordings, mask, tuple(groups), stride * ROW_S, tuple(_missing_channel_notes(common)), tracked)


def _without(logs: Sequence[Log], channels: Collection[str], *remarks: str) -> Sequence[Log]:
    if not channels:
        return logs
    return [
        replace(
            log,
            channels={name: values for name, values in log.channels.items() if name not in channels},
            remarks=(*log.remarks, *remarks),
        )
        for log in logs
    ]


def _without_contradicted_demands(logs: Sequence[Log]) -> Sequence[Log]:
    """Logs without the demands that one of them contradicts: brakes or motors mostly active at zero demand.

    Another controller acts then, whose demands are not logged; the logged ones would blame the actuators.
    """
    dropped: set[str] = set()
    for demands, measured, released in (
        (PRESSURE_DEMAND, PRESSURE, _RELEASED_PA), (MOTOR_DEMAND, MOTOR_TORQUE, _RELEASED_NM),
    ):  # fmt: skip
        for log in logs:
            if log.has(*demands, *measured):
                demand = np.fmax.reduce([np.abs(log.channels[name]) for name in demands])
                active = np.fmax.reduce([np.abs(log.channels[name]) for name in measured]) > 5.0 * released
                undemanded = active & ~_lasts(demand >= released, log.t_s, _RELEASE_S)
                if _duration_s(undemanded, log.t_s) > max(_UNDEMANDED_S, _CONTRADICTED * _duration_s(active, log.t_s)):
                    dropped |= set(demands)
    return _without(logs, dropped, "demands left out: brakes or motors act while their demand is zero")


def _lasts(demanded: Mask, t_s: Floats, time_s: float) -> Mask:
    """Where something is demanded, or was within the last ``time_s``."""
    last_s = np.maximum.accumulate(np.where(demanded, t_s, -np.inf))
    return np.asarray(t_s - last_s <= time_s)


def _duration_s(at: Mask, t_s: Floats) -> float:
    """Time of the samples ``at``, s."""
    return float(at.sum()) * float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0


def _missing_channel_notes(available: set[str]) -> list[str]:
    """What each missing channel leaves undiagnosed, for the reader."""
    by_channel = {
        "ax_mps2": "without acceleration: road grade, drag and a wrong accelerometer are indistinguishable",
        "speed_mps": "without a ground speed: tyre radius and speed scale are indistinguishable",
        "yaw_rate_rad_s": "without yaw rate: brakes that pull to one side show in wheel speeds only",
        "steer_rad": "without steering: the car is assumed to drive straight",
        "soc": "without state of charge: 70 % is assumed, limits of the battery are not tested",
    }
    notes = [text for name, text in by_channel.items() if name not in available]
    if not set(WHEEL_SPEED) <= available:
        notes.append("without all wheel speeds: single wheels, slip and radius are not diagnosed")
    if not set(PRESSURE) <= available:
        notes.append("without pressure at the wheels: hydraulics and pad friction are one gain")
    if not set(PRESSURE_DEMAND) <= available:
        notes.append("without pressure demand: the pressure control is not diagnosed")
    if not (set(MOTOR_TORQUE) | set(MOTOR_DEMAND)) & available:
        notes.append("without motor torque: the motors are assumed off; no known force to estimate the mass from")
    return notes


@dataclass(frozen=True, eq=False)
class _Rows:
    """One log on the 10 ms grid.

    Attributes
    ----------
    inputs : (rows, INPUT.size).  wheels : (rows, 4), rad/s.  spin : (rows,) median of the wheels, rad/s.
    ground_mps : (rows,); NaN where missing, as wheels and spin.  speed_mps : (rows,) of the wheels, else over ground.
    pressure_pa, torque_nm : (rows,) largest size of any wheel, measured or demanded.
    """

    inputs: Floats
    wheels: Floats
    spin: Floats
    ground_mps: Floats
    speed_mps: Floats
    pressure_pa: Floats
    torque_nm: Floats

    @property
    def released(self) -> Mask:
        """(rows,) where neither brakes nor motors act."""
        return (self.pressure_pa < _RELEASED_PA) & (self.torque_nm < _RELEASED_NM)


def _recording(log: Log, groups: Sequence[str], stride: int, radius_m: float, tracked: Collection[str]) -> Recording:
    """A log as a recording: resample, mask, assemble."""
    origin_s, sample_s = clock_origin_s(log.t_s), stride * ROW_S
    count = int((float(log.t_s[-1]) - origin_s) / ROW_S) // stride * stride
    grid_s = origin_s + ROW_S * np.arange(count)
    rows = _resample(log, grid_s, radius_m)
    segments = _segments(rows, stride)
    speed_mps = averaged(rows.speed_mps[:, None], stride)[:, 0]
    moving, resting = moving_and_resting(speed_mps, sample_s)
    slides = after_wheel_lock(rows.wheels, rows.ground_mps, ~rows.released, segments, radius_m)
    if slides.any():
        from_s = np.flatnonzero(slides)[0] * ROW_S
        remark = f"a wheel slides from {from_s:.2f} s on; motion is not compared from there to the end of its segment"
        log = replace(log, remarks=(*log.remarks, remark))
    grips = averaged(slides[:, None] * 1.0, stride)[:, 0] == 0.0
    compared = {}
    if "pressure" in groups and "pressure" not in tracked:
        compared = known_pressures(averaged(rows.inputs[:, INPUT.slice("pressure_demand_pa")], stride), sample_s)
    for kind in {"pressure", "motor"} & set(groups):
        compared |= {f"{kind}.left-right {axle}": np.zeros(len(grips)) for axle in copied_axles(log, kind)}
    charge = log.channels.get("soc")
    return Recording(
        log,
        rows.inputs,
        segments,
        {name: _measured(log, name, grid_s, stride) for name in groups},
        stride,
        moving=(moving & grips) * 1.0,
        resting=(resting & grips) * 1.0,
        speed_mps=speed_mps,
        pressure_pa=averaged(rows.pressure_pa[:, None], stride)[:, 0],
        state_of_charge=_STATE_OF_CHARGE if charge is None else float(np.nanmean(charge[:20])),
        timestamp_jitter_s=timestamp_jitter_s(log.t_s),
        compared=compared,
    )


def _resample(log: Log, grid_s: Floats, radius_m: float) -> _Rows:
    """A log at the times ``grid_s`` (rows,), s."""

    def columns(names: Sequence[str], hold: bool = False) -> Floats:
        return np.column_stack([without_gaps(resampled(log, name, grid_s, hold)) for name in names])

    inputs = np.zeros((len(grid_s), INPUT.size))
    inputs[:, INPUT.slice("pressure_pa")] = columns(PRESSURE)
    inputs[:, INPUT.slice("motor_torque_nm")] = columns(MOTOR_TORQUE)
    demands = PRESSURE_DEMAND if log.has(*PRESSURE_DEMAND) else PRESSURE
    inputs[:, INPUT.slice("pressure_demand_pa")] = columns(demands, hold=True)
    demands = MOTOR_DEMAND if log.has(*MOTOR_DEMAND) else MOTOR_TORQUE
    inputs[:, INPUT.slice("motor_demand_nm")] = columns(demands, hold=True)
    inputs[:, INPUT.slice("steering_wheel_rad")] = columns(["steer_rad"])
    wheels = np.column_stack([resampled(log, name, grid_s) for name in WHEEL_SPEED])
    inputs[:, INPUT.slice("wheel_speed_rad_s")] = np.column_stack([without_gaps(wheel) for wheel in wheels.T])
    spin = np.full(len(wheels), np.nan)
    known = np.isfinite(wheels).any(axis=1)
    spin[known] = np.nanmedian(wheels[known], axis=1)
    ground = resampled(log, "speed_mps", grid_s)
    speed = np.abs(without_gaps(spin * radius_m if known.any() else ground))

    def part(name: str) -> Floats:
        return inputs[:, INPUT.slice(name)]

    pressure = np.maximum(part("pressure_pa").max(axis=1), part("pressure_demand_pa").max(axis=1))
    torque = np.maximum(np.abs(part("motor_torque_nm")).max(axis=1), np.abs(part("motor_demand_nm")).max(axis=1))
    return _Rows(inputs, wheels, spin, ground, speed, pressure, torque)


def _segments(rows: _Rows, stride: int) -> tuple[Segment, ...]:
    """Stretches that are simulated on their own, each with its speed at the start."""
    spin = smoothed(without_gaps(rows.spin))
    ground = None if np.isfinite(rows.spin).any() else smoothed(without_gaps(rows.ground_mps))
    return tuple(
        Segment(first, last, float(spin[first]), None if ground is None else float(ground[first]))
        for first, last in pairwise(_segment_bounds(rows, stride))
    )


def _segment_bounds(rows: _Rows, stride: int) -> list[int]:
    """Rows where the simulation restarts: after a stop; in a curve, which reacts to the speed, after 3 s; else after
    8 s with brakes and motors released; else after 25 s."""
    speed, released = rows.speed_mps, rows.released
    turns = np.abs(rows.inputs[:, U.steering_wheel_rad]) > STRAIGHT_RAD
    count, bounds, begin = len(speed), [0], 0
    rest = speed < 0.3
    for row in range(1, count - int(2.0 / ROW_S)):
        length_s = (row - begin) * ROW_S
        fast = speed[row] > SLOW_MPS + 1.0
        stopped = rest[row] and not rest[row - 1] and length_s > 2.0
        turned = turns[row] and length_s > _TURNING_S and fast
        rolls = length_s > _SHORTEST_S and released[row] and fast
        if stopped or turned or rolls or length_s > _LONGEST_S:
            begin = (row + (int(SETTLE_S / ROW_S) if stopped else 0)) // stride * stride
            if begin > bounds[-1] and begin < count - int(1.0 / ROW_S):
                bounds.append(begin)
    return [*bounds, count]


def _measured(log: Log, group: str, grid_s: Floats, stride: int) -> Floats:
    """Channels of a group of tracks, (samples, channels); NaN where nothing was measured."""
    values = averaged(np.column_stack([resampled(log, channel, grid_s) for channel in TRACK[group]]), stride)
    for k, channel in enumerate(TRACK[group]):
        values[~has_sample(log, channel, float(grid_s[0]), len(values), stride), k] = np.nan
    if group in _FILTERED:
        values[: int(np.ceil(_FILTER_S / (stride * ROW_S)))] = np.nan
    return values

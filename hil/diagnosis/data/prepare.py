"""Logs into what the plant replays: inputs on a 10 ms grid, cut points, segments, and the tracks to compare."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.clock import clock_origin_s, timestamp_jitter_s
from hil.diagnosis.data.dataset import ROW_S, SLOW_MPS, Dataset, Recording, Segment
from hil.diagnosis.data.interpolation import at_samples
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
from hil.diagnosis.data.masks import after_wheel_lock
from plant.vectors import CUT, INPUT, U

SETTLE_S, _RINGS_S = 1.0, 2.0
"""For how long what begins or ends is not compared; and a car that came to rest, which rings on its brakes and springs:
when it stopped, to the hundredth, would matter more than all that was before (docs/decisions/0085)."""
_BEFORE_S = 0.2
"""How long before it is slow a car is not compared any more: the simulated one may be slow a little earlier."""
SHORTEST_S, LONGEST_S, TURNING_S = 8.0, 25.0, 3.0
STRAIGHT_RAD = 0.02  # of the steering wheel
_RELEASED_PA, _RELEASED_NM = 1e5, 20.0
_ASKED_PA = 2e4
_CONTRADICTED = 0.8
_CHARGE = 0.7  # where no log tells it
_SPARSE = 1.5
"""Rows from sample to sample, from which on a log tells less than there was: who asks does so more often, so that a
demand lies between two samples and was not held from one to the next, and a pressure bends between them."""
_TRACK = {
    "wheel": WHEEL_SPEED, "pressure": PRESSURE, "motor": MOTOR_TORQUE,
    "ax": ("ax_mps2",), "ay": ("ay_mps2",), "yaw": ("yaw_rate_rad_s",), "gps": ("speed_mps",),
}  # fmt: skip
MOTION = (*WHEEL_SPEED, "ax_mps2", "ay_mps2", "yaw_rate_rad_s")
"""Channels that swing with wheel and tyre within a few samples, but have no corners."""
FILTERED, FILTER_S = ("ax", "ay", "yaw"), 0.2
"""Channels whose simulated sensor has not seen what was before the log, and for how long that shows."""


def _without_unstated(logs: Sequence[Log], unstated: Collection[str]) -> Sequence[Log]:
    """Logs without demands of motors that no simulation can follow: the vehicle set says nothing of the motors."""
    measured = all(log.has(*MOTOR_TORQUE) for log in logs)
    return _without(logs, set(MOTOR_DEMAND) if "motor" in unstated and measured else ())


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


def prepare(logs: Sequence[Log], radius_m: float, unstated: Collection[str] = ()) -> Dataset:
    """Cut and grid logs.

    Of sections that are ``unstated`` in the vehicle set no simulation can follow a demand: torques of such motors are
    not compared, and pressures only where none is asked for, or of the left and the right where the same is.

    Raises
    ------
    UnusableError
        Nothing that moves or nothing that drives the brakes is measured.
    """
    logs = _without_contradicted_demands(_without_unstated(logs, unstated))
    there = set.intersection(*(set(log.channels) for log in logs))
    if not (set(WHEEL_SPEED) & there or "speed_mps" in there):
        raise UnusableError("neither wheel speeds nor a speed in every log; nothing says how the car moved")
    driven = [
        set(PRESSURE) <= there,
        set(PRESSURE_DEMAND) <= there,
        set(MOTOR_TORQUE) <= there,
        set(MOTOR_DEMAND) <= there,
    ]
    if not any(driven):
        raise UnusableError(
            "neither pressures nor motor torques, measured or demanded; nothing says what braked the car"
        )
    cut = CUT.zeros()
    cut[CUT.slice("pressure")] = 1.0 if driven[0] else 0.0
    cut[CUT.slice("motor_torque")] = 1.0 if driven[2] else 0.0
    cut[CUT.slice("motor_speed")] = 1.0 if set(WHEEL_SPEED) <= there else 0.0
    groups = [name for name, names in _TRACK.items() if set(names) <= there]
    if "wheel" not in groups and set(WHEEL_SPEED) & there:
        groups.insert(0, "wheel")  # some wheels only: the others are empty
    for name, demand in (("pressure", driven[1]), ("motor", driven[3])):
        if name in groups and not demand:
            groups.remove(name)  # nothing simulates it
    rate = max(float(np.median(np.diff(log.t_s))) for log in logs)
    stride = max(2, int(np.ceil(rate / ROW_S - 0.2)))
    followed = ("motor",) if "ehb" in unstated else ("pressure", "motor")
    drives = tuple(replace(_recording(log, groups, stride, radius_m, followed), number=k) for k, log in enumerate(logs))
    moving = sum(float(drive.moving.sum()) for drive in drives) * stride * ROW_S
    if moving < 4.0:
        raise UnusableError(f"the car moves for {moving:.1f} s in all; expected 4 s or more above {SLOW_MPS:g} m/s")
    return Dataset(drives, cut, tuple(groups), stride * ROW_S, tuple(_missing_channel_notes(there)), followed)


def _without_contradicted_demands(logs: Sequence[Log]) -> Sequence[Log]:
    """Logs without the demands that any of them contradicts: brakes or motors that act for long with nothing asked.

    Who sent what acted is then not in the log, and its demands would accuse the actuators.
    """
    dropped: set[str] = set()
    for demands, measured, none, much in (
        (PRESSURE_DEMAND, PRESSURE, _RELEASED_PA, 5.0 * _RELEASED_PA),
        (MOTOR_DEMAND, MOTOR_TORQUE, _RELEASED_NM, 5.0 * _RELEASED_NM),
    ):
        for log in logs:
            if log.has(*demands, *measured):
                asked = np.max([np.abs(log.channels[name]) for name in demands], axis=0)
                given = np.max([np.abs(log.channels[name]) for name in measured], axis=0)
                acting = given > much
                if acting.any() and (asked[acting] < none).mean() > _CONTRADICTED:
                    dropped |= set(demands)
    return _without(logs, dropped, "demands left out: the brakes or motors act while nothing is asked of them")


def _missing_channel_notes(there: set[str]) -> list[str]:
    """What each missing channel costs."""
    said = {
        "ax_mps2": "without acceleration: road grade, drag and a wrong accelerometer cannot be told apart",
        "speed_mps": "without a ground speed: tyre radius and speed scale are tied",
        "yaw_rate_rad_s": "without yaw rate: brakes pulling to one side show in wheel speeds only",
        "steer_rad": "without steering: the car is taken to drive straight",
        "soc": "without state of charge: 70 % is taken, limits of the battery are not tested",
    }
    costs = [text for name, text in said.items() if name not in there]
    if not set(WHEEL_SPEED) <= there:
        costs.append("without all wheel speeds: single wheels, slip and radius cannot be judged")
    if not set(PRESSURE) <= there:
        costs.append("without pressure at the wheels: hydraulics and pad friction are one gain")
    if not set(PRESSURE_DEMAND) <= there:
        costs.append("without pressure demand: nothing is said of the pressure control")
    if not (set(MOTOR_TORQUE) | set(MOTOR_DEMAND)) & there:
        costs.append("without motor torque: the motors are taken to be off; no known force to weigh the car with")
    return costs


def _recording(log: Log, groups: Sequence[str], stride: int, radius_m: float, followed: Collection[str]) -> Recording:
    begin, end = clock_origin_s(log.t_s), float(log.t_s[-1])
    rows = int((end - begin) / ROW_S) // stride * stride
    grid = begin + ROW_S * np.arange(rows)

    def on_grid(name: str, hold: bool = False) -> Floats:
        values = log.channels.get(name)
        if values is None:
            return np.full(rows, np.nan)
        good = np.isfinite(values)
        if not good.any():
            return np.full(rows, np.nan)
        cycle = float(np.median(np.diff(log.t_s[good]))) if good.sum() > 1 else 0.0
        if hold and cycle < _SPARSE * ROW_S:
            late = 0.4 * cycle  # stamps jitter
            at = np.clip(np.searchsorted(log.t_s[good], grid + late, side="right") - 1, 0, None)
            return np.asarray(values[good][at], np.float64)
        if name in MOTION or (name in PRESSURE and cycle >= _SPARSE * ROW_S):
            filled = at_samples(values[good], np.interp(grid, log.t_s[good], np.arange(good.sum(), dtype=np.float64)))
        else:
            filled = np.interp(grid, log.t_s[good], values[good])
        nearest = np.clip(np.searchsorted(log.t_s[good], grid), 1, max(int(good.sum()) - 1, 1))
        gap = np.diff(log.t_s[good])[nearest - 1] if good.sum() > 1 else np.full(rows, np.inf)
        filled[gap > 0.25] = np.nan
        return filled

    def input_of(measured: Sequence[str]) -> Floats:
        return np.column_stack([_filled(on_grid(name)) for name in measured])

    inputs = np.zeros((rows, INPUT.size))
    inputs[:, INPUT.slice("pressure_pa")] = input_of(PRESSURE)
    inputs[:, INPUT.slice("motor_torque_nm")] = input_of(MOTOR_TORQUE)
    for part, names, fallback in (
        ("pressure_demand_pa", PRESSURE_DEMAND, PRESSURE), ("motor_demand_nm", MOTOR_DEMAND, MOTOR_TORQUE),
    ):  # fmt: skip
        chosen = names if log.has(*names) else fallback
        inputs[:, INPUT.slice(part)] = np.column_stack([_filled(on_grid(name, hold=True)) for name in chosen])
    inputs[:, INPUT.slice("steering_wheel_rad")] = _filled(on_grid("steer_rad"))[:, None]

    wheels = np.column_stack([on_grid(name) for name in WHEEL_SPEED])
    inputs[:, INPUT.slice("wheel_speed_rad_s")] = np.column_stack([_filled(wheel) for wheel in wheels.T])
    turning = np.any(np.isfinite(wheels))
    spins = _median(wheels)
    ground = on_grid("speed_mps")
    speed = np.abs(_filled(spins * radius_m if turning else ground))
    brakes = inputs[:, INPUT.slice("pressure_pa")].max(axis=1)
    brakes = np.maximum(brakes, inputs[:, INPUT.slice("pressure_demand_pa")].max(axis=1))
    motors = np.maximum(
        np.abs(inputs[:, INPUT.slice("motor_torque_nm")]).max(axis=1),
        np.abs(inputs[:, INPUT.slice("motor_demand_nm")]).max(axis=1),
    )
    quiet = (brakes < _RELEASED_PA) & (motors < _RELEASED_NM)
    bent = np.abs(inputs[:, U.steering_wheel_rad]) > STRAIGHT_RAD
    bounds = _segment_bounds(speed, quiet, bent, stride)
    smooth = _smoothed(_filled(spins))
    smooth_ground = _smoothed(_filled(ground)) if not turning else None
    segments = tuple(
        Segment(a, b, float(smooth[a]), None if smooth_ground is None else float(smooth_ground[a]))
        for a, b in pairwise(bounds)
    )
    measured = {}
    for name in groups:
        columns = np.column_stack([on_grid(channel) for channel in _TRACK[name]])
        measured[name] = averaged(columns, stride)
        for k, channel in enumerate(_TRACK[name]):
            measured[name][~_sampled(log, channel, begin, len(measured[name]), stride), k] = np.nan
        if name in FILTERED:
            measured[name][: int(np.ceil(FILTER_S / (stride * ROW_S)))] = np.nan
    compared = {}
    if "pressure" in measured and "pressure" not in followed:
        compared = _pressures_known(averaged(inputs[:, INPUT.slice("pressure_demand_pa")], stride), stride)
    slow = averaged(speed[:, None], stride)[:, 0]
    before, after = (max(int(time_s / (stride * ROW_S)), 1) for time_s in (_BEFORE_S, SETTLE_S))
    near_stop = np.convolve(slow < SLOW_MPS, np.ones(before + 1 + after))[before : before + len(slow)] > 0.5
    rings = max(int(_RINGS_S / (stride * ROW_S)), 1)
    resting = np.convolve(slow > 0.02, np.ones(2 * rings + 1), mode="same") < 0.5
    resting[: 2 * after] = False  # the simulated body first sinks into its springs
    slid = after_wheel_lock(wheels, ground, ~quiet, segments, radius_m)
    if slid.any():
        log = replace(log, remarks=(*log.remarks, _sliding_remark(slid)))
    held = averaged(slid[:, None] * 1.0, stride)[:, 0] == 0.0
    return Recording(
        log,
        inputs,
        segments,
        measured,
        stride,
        (~near_stop & held) * 1.0,
        (resting & held) * 1.0,
        slow,
        averaged(brakes[:, None], stride)[:, 0],
        _charge(log),
        timestamp_jitter_s=timestamp_jitter_s(log.t_s),
        compared=compared,
    )


def _sliding_remark(slid: NDArray[np.bool_]) -> str:
    since = np.flatnonzero(slid)[0] * ROW_S
    return f"a wheel slides from {since:.2f} s on; motion is not compared from there to the end of its segment"


def _pressures_known(demand_pa: Floats, stride: int) -> dict[str, Floats]:
    """Where pressures of hydraulics that nobody states are known, by track, (samples,): none are where none is asked
    for, and both of an axle are alike where the same is asked of both. ``demand_pa`` (samples, 4)."""

    def never_since(asked: Floats) -> Floats:
        begun = asked > _ASKED_PA
        begun[0] = True  # the simulated one starts where the measured one does
        return (np.convolve(begun, np.ones(1 + int(SETTLE_S / (stride * ROW_S))))[: len(begun)] < 0.5) * 1.0

    released = never_since(demand_pa.max(axis=1))
    alike = [never_since(np.abs(demand_pa[:, left] - demand_pa[:, left + 1])) for left in (0, 2)]
    return {
        "pressure.mean": released, "pressure.front-rear": released,
        "pressure.left-right front": alike[0], "pressure.left-right rear": alike[1],
    }  # fmt: skip


def _charge(log: Log) -> float:
    """State of charge at the start of a log."""
    told = log.channels.get("soc")
    return _CHARGE if told is None else float(np.nanmean(told[:20]))


def _sampled(
    log: Log, channel: str, begin: float, samples: int, stride: int
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Where a channel was really measured: between sparse samples a straight line is no measurement."""
    values = log.channels.get(channel)
    if values is None:
        return np.zeros(samples, bool)
    t = log.t_s[np.isfinite(values)]
    if len(t) < 2 or float(np.median(np.diff(t))) < 1.5 * stride * ROW_S:
        return np.ones(samples, bool)
    bins = np.round((t - begin) / (stride * ROW_S) - 0.25).astype(np.int64)
    found = np.zeros(samples, bool)
    found[bins[(bins >= 0) & (bins < samples)]] = True
    return found


def averaged(values: Floats, stride: int) -> Floats:
    """Means of ``stride`` rows, (rows // stride, columns)."""
    out = np.empty((len(values) // stride, values.shape[1]))
    _means(values, stride, out)
    return out


@compiled
def _means(values: Floats, stride: int, out: Floats) -> None:
    for t in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(stride):
                total += values[stride * t + j, k]
            out[t, k] = total / stride


def _filled(values: Floats) -> Floats:
    good = np.isfinite(values)
    if not good.any():
        return np.zeros(len(values))
    at = np.arange(len(values))
    return np.asarray(np.interp(at, at[good], values[good]))


def _median(wheels: Floats) -> Floats:
    some = np.isfinite(wheels).any(axis=1)
    found = np.full(len(wheels), np.nan)
    found[some] = np.nanmedian(wheels[some], axis=1)
    return found


def _smoothed(values: Floats) -> Floats:
    """Straight line through the 0.2 s that follow, its value at the start."""
    n = 20
    padded = np.concatenate((values, np.full(n - 1, values[-1])))
    windows = np.lib.stride_tricks.sliding_window_view(padded, n)
    x = np.arange(n) - (n - 1) / 2.0
    slope = windows @ x / float(x @ x)
    return np.asarray(windows.mean(axis=1) + slope * x[0])


def _segment_bounds(speed: Floats, quiet: Floats, bent: Floats, stride: int) -> list[int]:
    """Where to restart: at rest, else released after 8 s, else after 25 s; in bends, which answer speed, after 3 s."""
    rows, bounds, begin = len(speed), [0], 0
    rest = speed < 0.3
    for row in range(1, rows - int(2.0 / ROW_S)):
        since = (row - begin) * ROW_S
        stopped = rest[row] and not rest[row - 1] and since > 2.0
        turned = bent[row] and since > TURNING_S and speed[row] > SLOW_MPS + 1.0
        rolls = since > SHORTEST_S and quiet[row] and speed[row] > SLOW_MPS + 1.0
        if stopped or turned or rolls or since > LONGEST_S:
            begin = (row + (int(SETTLE_S / ROW_S) if stopped else 0)) // stride * stride
            if begin > bounds[-1] and begin < rows - int(1.0 / ROW_S):
                bounds.append(begin)
    return [*bounds, rows]

"""Where the simulation is compared with a log, and whether the car may turn in it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.data.dataset import ROW_S, SLOW_MPS, Segment
from hil.diagnosis.data.log import Floats, Log

Mask = NDArray[np.bool_]
SETTLE_S, _RINGS_S = 1.0, 2.0
"""Time after a change (stop, start, demand) that is not compared; and the time a car that stopped oscillates on its
brakes and springs: the exact time of the stop would outweigh all that was before
(docs/decisions/replay-and-comparison.md)."""
_BEFORE_S = 0.2
"""Time before the car is slow that is not compared: the simulated one may be slow a little earlier."""
_AT_REST_MPS = 0.02
_DEMAND_PA = 2e4
_LOCKED_SLIP, _SLIDES_SLIP, _ROLLS_SLIP = 0.5, 0.2, 0.1
"""Slip of a wheel that has locked or spins; slip beyond the peak of any tyre's curve on a dry road (0.1 to 0.2; Pacejka
2012, ch. 1); slip of a wheel that rolls."""
_LASTS_S = 0.1
_LEAST_MPS = 4.0  # below, sensors with teeth miss what a wheel does within a tenth of a second
_TURN_S, _TURN_RAD_S = 0.5, 0.003
"""Averaging time of the yaw rate, and the mean beside its median up to which the car does not turn: 0.2 deg/s, a curve
of 7 km radius at 72 km/h."""


def moving_and_resting(speed_mps: Floats, sample_s: float) -> tuple[Mask, Mask]:
    """(samples,) where the wheel and body motion, and where the body at rest is compared, by the speed (samples,)."""
    before, after = (max(int(time_s / sample_s), 1) for time_s in (_BEFORE_S, SETTLE_S))
    near_stop = np.convolve(speed_mps < SLOW_MPS, np.ones(before + 1 + after))[before : before + len(speed_mps)] > 0.5
    rings = max(int(_RINGS_S / sample_s), 1)
    moved = np.convolve(speed_mps > _AT_REST_MPS, np.ones(2 * rings + 1))  # "same" is as long as the longer of both
    resting = moved[rings : rings + len(speed_mps)] < 0.5
    resting[: 2 * after] = False  # the simulated body first sinks into its springs
    return ~near_stop, resting


def known_pressures(demand_pa: Floats, sample_s: float) -> dict[str, Floats]:
    """Where the pressures of hydraulics that no set states are known, by track, (samples,), 1 or 0.

    They are zero without a demand, and equal on both sides of an axle if the demands are; ``demand_pa`` (samples, 4).
    """

    def settled(demand: Floats) -> Floats:
        active = demand > _DEMAND_PA
        active[0] = True  # the simulated pressure starts at the measured one
        return (np.convolve(active, np.ones(1 + int(SETTLE_S / sample_s)))[: len(active)] < 0.5) * 1.0

    released = settled(demand_pa.max(axis=1))
    equal = [settled(np.abs(demand_pa[:, left] - demand_pa[:, left + 1])) for left in (0, 2)]
    return {
        "pressure.mean": released, "pressure.front-rear": released,
        "pressure.left-right front": equal[0], "pressure.left-right rear": equal[1],
    }  # fmt: skip


def after_wheel_lock(
    wheels: Floats, ground_mps: Floats, acting: Mask, segments: Sequence[Segment], radius_m: float
) -> Mask:
    """(rows,) of 10 ms from where a wheel that rolled locks or spins, to the end of its segment.

    When the wheel grips again decides how a sliding car yaws and stops: two simulations that differ by a thousandth end
    half a turn away from each other. Residuals from there on carry no information
    (docs/decisions/replay-and-comparison.md).

    Parameters
    ----------
    wheels : (rows, 4), rad/s, NaN where unknown.  ground_mps : (rows,), likewise.
    acting : (rows,), where brakes or motors act: without, a wheel that stands still is a failed sensor.
    """
    speeds = np.abs(np.where(np.isfinite(wheels), wheels, np.nan))
    known = np.isfinite(speeds).any(axis=1)
    least, most = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    least[known], most[known] = np.nanmin(speeds[known], axis=1), np.nanmax(speeds[known], axis=1)
    rolling = np.fmax(most, np.abs(ground_mps) / radius_m)
    slip = np.zeros(len(speeds))
    fast = known & (rolling * radius_m > _LEAST_MPS)
    slip[fast] = 1.0 - least[fast] / rolling[fast]
    lasting = int(_LASTS_S / ROW_S)
    locked = np.convolve((slip > _LOCKED_SLIP) & acting, np.ones(lasting), mode="full")[: len(slip)] > lasting - 0.5
    after = np.zeros(len(slip), bool)
    for segment in segments:
        at = np.flatnonzero(locked[segment.first : segment.last])
        if not len(at):
            continue
        end = segment.first + int(at[0])
        grips = np.flatnonzero(slip[:end] < _SLIDES_SLIP)
        rolled = (slip[:end] < _ROLLS_SLIP)[fast[:end]].any()
        if len(grips) and rolled:
            after[max(int(grips[-1]) + 1, segment.first) : segment.last] = True
    return after


def is_straight_line(logs: Sequence[Log]) -> bool:
    """Whether the car drives straight in all logs: no log shows its steering wheel moving or the car turning.

    A driver who is not logged keeps it on its line against brakes that pull to one side. A steering wheel whose angle
    is missing or constant in all logs was not measured.
    """
    return not any(_is_steered(log) or _turns(log) for log in logs)


def _is_steered(log: Log) -> bool:
    angle = log.channels.get("steer_rad")
    return angle is not None and bool(np.isfinite(angle).any()) and float(np.nanmax(angle) - np.nanmin(angle)) > 0.0


def _turns(log: Log) -> bool:
    rate = log.channels.get("yaw_rate_rad_s")
    if rate is None:
        return False
    finite = np.isfinite(rate)
    rate = rate[finite]
    if len(rate) < 2:
        return False
    window = max(int(_TURN_S / max(float(np.median(np.diff(log.t_s[finite]))), 1e-3)), 1)
    noise = 1.48 * float(np.median(np.abs(np.diff(rate)))) / np.sqrt(2.0 * window)
    smooth = np.convolve(rate - np.median(rate), np.ones(window) / window, mode="valid")
    return bool(np.abs(smooth).max(initial=0.0) > max(_TURN_RAD_S, 5.0 * noise))

"""Supervision: faults of the inputs, and the operating mode they allow.

A downgrade happens in the tick in which its cause is found. An upgrade goes one mode at a time, at most one a
second, and only after a number of valid frames in sequence from every source. INIT goes straight to what the
faults allow, once every source has brought that many.
"""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode, Fault
from ecu.law.base_brake import PedalReading
from ecu.law.types import PLAUSIBLE, Brake, Inputs, Plausibility, Source
from ecu.parameters.control import SupervisionParameters

_SOURCE_FAULT = (
    (Source.WHEEL_SPEED_FRONT, Fault.WHEEL_SPEED_FRONT),
    (Source.WHEEL_SPEED_REAR, Fault.WHEEL_SPEED_REAR),
    (Source.BODY_MOTION, Fault.BODY_MOTION),
    (Source.EHB_PRESSURE_FRONT, Fault.EHB_PRESSURE_FRONT),
    (Source.EHB_PRESSURE_REAR, Fault.EHB_PRESSURE_REAR),
    (Source.MOTOR_FRONT, Fault.MOTOR_FRONT),
    (Source.MOTOR_REAR, Fault.MOTOR_REAR),
    (Source.STEERING, Fault.STEERING),
    (Source.BATTERY, Fault.BATTERY),
)
_BOTH_WHEEL_SPEEDS = Fault.WHEEL_SPEED_FRONT | Fault.WHEEL_SPEED_REAR
_BOTH_MOTORS = Fault.MOTOR_FRONT | Fault.MOTOR_REAR
_PEDALS = Fault.PEDAL_1 | Fault.PEDAL_2


class ModeMemory(NamedTuple):
    """State of the supervision.

    ``valid_counts``: valid frames in sequence of each source (saturating); the rest are times since or during, s.
    """

    mode: BrakeMode
    valid_counts: tuple[int, ...]
    since_upgrade_s: float
    own_map_s: float


def initial_modes() -> ModeMemory:
    """INIT, nothing received yet."""
    return ModeMemory(BrakeMode.INIT, (0,) * len(Source), math.inf, 0.0)


def lost_sources(inputs: Inputs, p: SupervisionParameters) -> tuple[bool, ...]:
    """Whether each source has timed out (never received counts as lost)."""
    limit_s = p.timeout_s
    lost = [not h.age_s < limit_s for h in inputs.health]
    lost[Source.BATTERY] = not inputs.health[Source.BATTERY].age_s < p.battery_timeout_s
    return tuple(lost)


def _all_there(inputs: Inputs) -> bool:
    """Whether every actuator works and every value is available: a sum is finite only where all its parts are."""
    total = inputs.acceleration_x_mps2 + inputs.acceleration_y_mps2 + inputs.yaw_rate_rad_s
    total += inputs.steering_wheel_angle_rad + inputs.charge_power_w
    total += sum(inputs.wheel_speed_rad_s) + sum(inputs.pressure_pa)
    total += sum(inputs.motor_current_a) + sum(inputs.motor_available_nm)
    return math.isfinite(total) and True not in inputs.motor_failed and Brake.FAILED not in inputs.brake


def _missing(inputs: Inputs) -> Fault:
    """Sources whose message arrives but says that its values are not available."""
    faults = Fault.NONE
    if _all_there(inputs):
        return faults
    finite = math.isfinite
    for axle, bits in enumerate(
        (
            (Fault.WHEEL_SPEED_FRONT, Fault.EHB_PRESSURE_FRONT, Fault.MOTOR_FRONT),
            (Fault.WHEEL_SPEED_REAR, Fault.EHB_PRESSURE_REAR, Fault.MOTOR_REAR),
        )
    ):
        left, right = 2 * axle, 2 * axle + 1
        speed, pressure, motor = bits
        if not (finite(inputs.wheel_speed_rad_s[left]) and finite(inputs.wheel_speed_rad_s[right])):
            faults |= speed
        if (
            not (finite(inputs.pressure_pa[left]) and finite(inputs.pressure_pa[right]))
            or inputs.brake[axle] == Brake.FAILED
        ):
            faults |= pressure
        if any(
            inputs.motor_failed[w] or not finite(inputs.motor_current_a[w]) or not finite(inputs.motor_available_nm[w])
            for w in (left, right)
        ):
            faults |= motor
    if not (
        finite(inputs.acceleration_x_mps2) and finite(inputs.acceleration_y_mps2) and finite(inputs.yaw_rate_rad_s)
    ):
        faults |= Fault.BODY_MOTION
    if not finite(inputs.steering_wheel_angle_rad):
        faults |= Fault.STEERING
    if not finite(inputs.charge_power_w):
        faults |= Fault.BATTERY
    return faults


def _allowed(inputs: Inputs, lost: tuple[bool, ...], bad: int, faults: Fault, p: SupervisionParameters) -> BrakeMode:
    """Best mode that the faults allow; ``bad``: most unusable frames in a row."""
    if bad >= p.bad_frames_to_downgrade:
        return BrakeMode.SAFE_STOP if faults & _PEDALS == _PEDALS else BrakeMode.FRICTION_ONLY
    if not faults:
        return BrakeMode.NORMAL
    if faults & _PEDALS == _PEDALS:
        return BrakeMode.SAFE_STOP
    if (
        faults & (Fault.LINK | Fault.EHB_OWN_MAP | Fault.BATTERY)
        or faults & _BOTH_WHEEL_SPEEDS == _BOTH_WHEEL_SPEEDS
        or (lost[Source.MOTOR_FRONT] and lost[Source.MOTOR_REAR])
        or all(inputs.motor_failed)
    ):
        return BrakeMode.FRICTION_ONLY
    return BrakeMode.DEGRADED


def _implausible(plausibility: Plausibility) -> Fault:
    """Faults of what does not agree with the rest."""
    faults = Fault.NONE
    for wheels, front, rear in (
        (plausibility.wheel_speed, Fault.WHEEL_SPEED_FRONT, Fault.WHEEL_SPEED_REAR),
        (plausibility.pressure, Fault.EHB_PRESSURE_FRONT, Fault.EHB_PRESSURE_REAR),
        (plausibility.motor_torque, Fault.MOTOR_FRONT, Fault.MOTOR_REAR),
    ):
        if wheels[0] or wheels[1]:
            faults |= front
        if wheels[2] or wheels[3]:
            faults |= rear
    for channel, fault in zip(plausibility.pedal, (Fault.PEDAL_1, Fault.PEDAL_2), strict=True):
        if channel:
            faults |= fault
    if plausibility.pedal_disagree:
        faults |= Fault.PEDAL_DISAGREE
    if plausibility.acceleration:
        faults |= Fault.BODY_MOTION
    return faults


def supervise(
    memory: ModeMemory,
    inputs: Inputs,
    lost: tuple[bool, ...],
    pedal: PedalReading,
    plausibility: Plausibility,
    p: SupervisionParameters,
    dt_s: float,
) -> tuple[ModeMemory, Fault]:
    """Advance the operating mode by one tick; returns the new state and the faults present.

    Parameters
    ----------
    lost : sources that have timed out, from `lost_sources`.
    pedal : what the two channels say.
    plausibility : what does not agree with the rest.
    """
    faults = _missing(inputs)
    if True in lost:
        for source, fault in _SOURCE_FAULT:
            if lost[source]:
                faults |= fault
    if plausibility != PLAUSIBLE:
        faults |= _implausible(plausibility)
    if pedal.channel_1_lost:
        faults |= Fault.PEDAL_1
    if pedal.channel_2_lost:
        faults |= Fault.PEDAL_2
    own_map = memory.mode != BrakeMode.INIT and memory.mode != BrakeMode.SAFE_STOP and Brake.OWN_MAP in inputs.brake
    own_map_s = min(memory.own_map_s + dt_s, 2.0 * p.own_map_tolerated_s) if own_map else 0.0
    if own_map_s > p.own_map_tolerated_s:
        faults |= Fault.EHB_OWN_MAP
    if inputs.link_down:
        faults |= Fault.LINK
    valid_counts, most = memory.valid_counts, p.frames_to_upgrade
    bad = max([h.bad_in_row for h in inputs.health])
    if bad or True in lost or min(valid_counts) < most:
        valid_counts = tuple(
            0 if gone or h.bad_in_row else min(run + h.fresh, most)
            for run, h, gone in zip(valid_counts, inputs.health, lost, strict=True)
        )
    since_upgrade_s = memory.since_upgrade_s + dt_s
    mode = memory.mode
    allowed = _allowed(inputs, lost, bad, faults, p)
    if mode == BrakeMode.INIT:
        if min(valid_counts) >= p.frames_to_upgrade:
            mode = allowed
            since_upgrade_s = 0.0
    elif allowed > mode:
        mode = allowed
    elif allowed < mode and min(valid_counts) >= p.frames_to_upgrade and since_upgrade_s >= p.upgrade_interval_s:
        mode = BrakeMode(mode - 1)
        since_upgrade_s = 0.0
    return ModeMemory(mode, valid_counts, since_upgrade_s, own_map_s), faults

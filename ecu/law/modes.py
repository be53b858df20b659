"""Supervision: what is wrong with the inputs, and the operating mode that it allows.

What is wrong is a set of trouble codes (`ecu.law.trouble_codes`); the worst of their reactions is the best mode. A
downgrade happens in the tick in which its cause is found. An upgrade goes one mode at a time, at most one a second,
and only after a number of valid frames in sequence from every source. INIT goes straight to what the codes allow, once
every source has brought that many.
"""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode, Fault
from ecu.law.base_brake import PedalReading
from ecu.law.communication import ALL_CLEAN, Streams
from ecu.law.trouble_codes import BIT, bits, consequence
from ecu.law.types import OTHERS_WELL, PLAUSIBLE, Brake, Inputs, Plausibility, Source
from ecu.parameters.control import SupervisionParameters

_LOST, _NOT_AVAILABLE = bits("{}_lost"), bits("{}_not_available")
_CORRUPT, _SECOND_SENDER, _OUT_OF_TIME = bits("{}_corrupt"), bits("{}_second_sender"), bits("{}_out_of_time")
_SPEED_IMPLAUSIBLE, _PRESSURE_IMPLAUSIBLE = bits("wheel_speed_{}_implausible"), bits("pressure_{}_implausible")
_MOTOR_FAILED, _MOTOR_TORQUE = bits("motor_{}_failed"), bits("motor_{}_torque")
_NONE_OUT = (False,) * len(Source)
_BATTERY_OUT = (*_NONE_OUT[1:], True)
_BRAKE_FAILED = (BIT["brake_front_failed"], BIT["brake_rear_failed"])


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


def timed_out_sources(inputs: Inputs, p: SupervisionParameters) -> tuple[bool, ...]:
    """Whether each source has timed out (never received counts as that)."""
    health, limit_s = inputs.health, p.timeout_s
    battery = not health[-1].age_s < p.battery_timeout_s
    if health[:-1] == OTHERS_WELL:
        return _BATTERY_OUT if battery else _NONE_OUT
    return (*[not h.age_s < limit_s for h in health[:-1]], battery)


def lost_sources(timed_out: tuple[bool, ...], streams: Streams) -> tuple[bool, ...]:
    """Whether nothing of each source may be used: it has timed out, or its frames may be another's."""
    if streams is ALL_CLEAN:
        return timed_out
    return tuple([out or stream.foreign_found for out, stream in zip(timed_out, streams, strict=True)])


def _all_there(inputs: Inputs) -> bool:
    """Whether every actuator works and every value is available: a sum is finite only where all its parts are."""
    total = inputs.acceleration_x_mps2 + inputs.acceleration_y_mps2 + inputs.yaw_rate_rad_s
    total += inputs.steering_wheel_angle_rad + inputs.charge_power_w
    total += sum(inputs.wheel_speed_rad_s) + sum(inputs.pressure_pa)
    total += sum(inputs.motor_current_a) + sum(inputs.motor_available_nm)
    return math.isfinite(total) and True not in inputs.motor_failed and Brake.FAILED not in inputs.brake


def _missing(inputs: Inputs, lost: tuple[bool, ...]) -> int:
    """Codes of sources whose message arrives but says that its values are not available, or of a failure."""
    values: dict[Source, tuple[float, ...]] = {
        Source.BODY_MOTION: (inputs.acceleration_x_mps2, inputs.acceleration_y_mps2, inputs.yaw_rate_rad_s),
        Source.STEERING: (inputs.steering_wheel_angle_rad,),
        Source.BATTERY: (inputs.charge_power_w,),
    }
    for axle, (speed, pressure, motor) in enumerate(
        (
            (Source.WHEEL_SPEED_FRONT, Source.EHB_PRESSURE_FRONT, Source.MOTOR_FRONT),
            (Source.WHEEL_SPEED_REAR, Source.EHB_PRESSURE_REAR, Source.MOTOR_REAR),
        )
    ):
        left, right = 2 * axle, 2 * axle + 1
        values[speed] = (inputs.wheel_speed_rad_s[left], inputs.wheel_speed_rad_s[right])
        values[pressure] = (inputs.pressure_pa[left], inputs.pressure_pa[right])
        values[motor] = (inputs.motor_current_a[left], inputs.motor_current_a[right])
        values[motor] += (inputs.motor_available_nm[left], inputs.motor_available_nm[right])
    active = 0
    for source, parts in values.items():
        if not lost[source] and not all(map(math.isfinite, parts)):
            active |= _NOT_AVAILABLE[source]
    motor_lost = (lost[Source.MOTOR_FRONT],) * 2 + (lost[Source.MOTOR_REAR],) * 2
    for wheel, failed in enumerate(inputs.motor_failed):
        if failed and not motor_lost[wheel]:
            active |= _MOTOR_FAILED[wheel]
    for axle, source in enumerate((Source.EHB_PRESSURE_FRONT, Source.EHB_PRESSURE_REAR)):
        if inputs.brake[axle] == Brake.FAILED and not lost[source]:
            active |= _BRAKE_FAILED[axle]
    return active


def _of_streams(timed_out: tuple[bool, ...], streams: Streams) -> int:
    """Codes of frames that do not come or cannot be believed."""
    active = 0
    for source, (out, stream) in enumerate(zip(timed_out, streams, strict=True)):
        if stream.corrupted:
            active |= _CORRUPT[source]
        if stream.second_sender:
            active |= _SECOND_SENDER[source]
        elif stream.out_of_time:
            active |= _OUT_OF_TIME[source]
        elif out:
            active |= _LOST[source]
    return active


def _implausible(plausibility: Plausibility) -> int:
    active = 0
    for flags, of in (
        (plausibility.wheel_speed, _SPEED_IMPLAUSIBLE),
        (plausibility.pressure, _PRESSURE_IMPLAUSIBLE),
        (plausibility.motor_torque, _MOTOR_TORQUE),
        (plausibility.pedal, (BIT["pedal_1_implausible"], BIT["pedal_2_implausible"])),
        ((plausibility.pedal_disagree,), (BIT["pedal_disagree"],)),
        ((plausibility.acceleration,), (BIT["acceleration_implausible"],)),
    ):
        for flag, bit in zip(flags, of, strict=True):
            active |= bit if flag else 0
    return active


def _together(
    inputs: Inputs, lost: tuple[bool, ...], pedal: PedalReading, plausibility: Plausibility, active: int
) -> int:
    """Codes of what is worse together than each alone."""
    odd = [not math.isfinite(w) or i for w, i in zip(inputs.wheel_speed_rad_s, plausibility.wheel_speed, strict=True)]
    front = lost[Source.WHEEL_SPEED_FRONT] or odd[0] or odd[1]
    rear = lost[Source.WHEEL_SPEED_REAR] or odd[2] or odd[3]
    if front and rear:
        active |= BIT["wheel_speed_both_axles"]
    dead = [a or b for a, b in zip(inputs.motor_failed, plausibility.motor_torque, strict=True)]
    front, rear = lost[Source.MOTOR_FRONT] or (dead[0] and dead[1]), lost[Source.MOTOR_REAR] or (dead[2] and dead[3])
    if front and rear:
        active |= BIT["motors_none"]
    if not lost[Source.PEDAL]:
        gone_1, gone_2 = pedal.channel_1_lost, pedal.channel_2_lost
        active |= (BIT["pedal_1_lost"] if gone_1 else 0) | (BIT["pedal_2_lost"] if gone_2 else 0)
        if (gone_1 or plausibility.pedal[0]) and (gone_2 or plausibility.pedal[1]):
            active |= BIT["pedal_none"]
    return active


def supervise(
    memory: ModeMemory,
    inputs: Inputs,
    timed_out: tuple[bool, ...],
    lost: tuple[bool, ...],
    streams: Streams,
    pedal: PedalReading,
    plausibility: Plausibility,
    p: SupervisionParameters,
    dt_s: float,
) -> tuple[ModeMemory, int, Fault]:
    """Advance the operating mode by one tick; returns the new state, the active trouble codes, the faults they show as.

    Parameters
    ----------
    timed_out, lost : sources that have timed out, and those not to be used, from `timed_out_sources`, `lost_sources`.
    streams : what is held against their frames, from `judge_streams`.
    pedal : what the two channels say.
    plausibility : what does not agree with the rest.
    """
    active = 0
    whole = _all_there(inputs)
    if not whole:
        active |= _missing(inputs, lost)
    if True in timed_out or streams is not ALL_CLEAN:
        active |= _of_streams(timed_out, streams)
    if plausibility is not PLAUSIBLE:
        active |= _implausible(plausibility)
    if active or not whole or pedal.channel_1_lost or pedal.channel_2_lost:
        active = _together(inputs, lost, pedal, plausibility, active)
    own_map = memory.mode != BrakeMode.INIT and memory.mode != BrakeMode.SAFE_STOP and Brake.OWN_MAP in inputs.brake
    own_map_s = min(memory.own_map_s + dt_s, 2.0 * p.own_map_tolerated_s) if own_map else 0.0
    if own_map_s > p.own_map_tolerated_s:
        active |= BIT["brake_own_map"]
    if inputs.link_down:
        active |= BIT["link_down"]
    allowed, faults = consequence(active) if active else (BrakeMode.NORMAL, Fault.NONE)

    valid_counts, most = memory.valid_counts, p.frames_to_upgrade
    health = inputs.health
    bad = health[-1].bad_in_row or (health[:-1] != OTHERS_WELL and any(h.bad_in_row for h in health))
    if bad or True in lost or min(valid_counts) < most:
        valid_counts = tuple(
            0 if gone or h.bad_in_row else min(run + h.fresh, most)
            for run, h, gone in zip(valid_counts, health, lost, strict=True)
        )
    since_upgrade_s = memory.since_upgrade_s + dt_s
    mode = memory.mode
    if mode == BrakeMode.INIT:
        if min(valid_counts) >= p.frames_to_upgrade:
            mode = allowed
            since_upgrade_s = 0.0
    elif allowed > mode:
        mode = allowed
    elif allowed < mode and min(valid_counts) >= p.frames_to_upgrade and since_upgrade_s >= p.upgrade_interval_s:
        mode = BrakeMode(mode - 1)
        since_upgrade_s = 0.0
    return ModeMemory(mode, valid_counts, since_upgrade_s, own_map_s), active, faults

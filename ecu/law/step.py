"""The control law: one pure step from inputs to outputs.

Pedal -> demanded deceleration -> brake torque of each wheel -> motors and friction -> pressures, under the operating
mode that the supervision allows. Losing an input never releases pressure: what the motors lose goes to the friction
brake, and without any pedal the last demand stands until the brake is asked to follow its own pedal map.
"""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode
from ecu.law import base_brake, blend, estimator, modes, trouble_codes
from ecu.law.actuation import actuate
from ecu.law.communication import ALL_CLEAN, Streams, judge_streams
from ecu.law.types import PLAUSIBLE, UNKNOWN, ZERO, Brake, Four, Inputs, Outputs, Source
from ecu.parameters.ecu import EcuParameters

SAMPLE_S = 0.01  # the sensors' cycle: the observer steps once for each, however fast the task
CONFIDENCE_STEPS = 7


class Memory(NamedTuple):
    """State of the law between two steps.

    ``time_s``: since the start; ``streams``, ``troubles``: what is held against the received frames, what was found.
    ``deceleration_mps2``: last valid demand, ``recent_mps2``: those of the last ticks; ``without_pedal_s``: time since
    there was one; ``handed_over``: the brake has been asked to follow its own pedal map. ``charge``: what the shares of
    motors and friction count on; ``observer``: state of the chosen observer; ``friction``: pad friction in use.
    """

    time_s: float
    streams: Streams
    modes: modes.ModeMemory
    troubles: trouble_codes.TroubleMemory
    disagreement_s: float
    deceleration_mps2: float
    recent_mps2: tuple[float, float, float]
    without_pedal_s: float
    handed_over: bool
    blending_factor: float
    charge: blend.ChargePower
    observer: estimator.Vector
    since_sample_s: float
    estimates: estimator.Estimates
    friction: Four


def initial_memory(parameters: EcuParameters) -> Memory:
    """State before the first step."""
    mu = parameters.friction_brake.pad_friction
    return Memory(
        time_s=0.0,
        streams=ALL_CLEAN,
        modes=modes.initial_modes(),
        troubles=trouble_codes.NO_TROUBLE,
        disagreement_s=0.0,
        deceleration_mps2=0.0,
        recent_mps2=(0.0, 0.0, 0.0),
        without_pedal_s=0.0,
        handed_over=False,
        blending_factor=parameters.blend.blending_factor,
        charge=blend.ChargePower(0.0, 0.0, 0.0),
        observer=estimator.initial_state(parameters),
        since_sample_s=0.0,
        estimates=estimator.Estimates(0.0, UNKNOWN, (mu, mu, mu, mu), ZERO, 1.0),
        friction=(mu, mu, mu, mu),
    )


def step(memory: Memory, inputs: Inputs, parameters: EcuParameters, dt_s: float) -> tuple[Memory, Outputs]:
    """Advance the control law by one tick.

    Parameters
    ----------
    memory : state after the last step; not changed.
    inputs : what the sensors say now.
    dt_s : time since the last step.
    """
    p = parameters
    time_s = memory.time_s + dt_s
    timed_out = modes.timed_out_sources(inputs, p.supervision)
    streams = judge_streams(memory.streams, inputs.health, timed_out, p.supervision, dt_s)
    lost = modes.lost_sources(timed_out, streams)
    pedal = base_brake.read_pedal(inputs, lost[Source.PEDAL], p.supervision.pedal_disagreement)
    known = memory.estimates
    disagreement_s = memory.disagreement_s + dt_s if pedal.channels_disagree else 0.0
    disagree = disagreement_s > p.supervision.pedal_disagreement_s
    plausibility = PLAUSIBLE
    if disagree or known.stuck or known.implausible != estimator.PLAUSIBLE:
        plausibility = PLAUSIBLE._replace(
            wheel_speed=known.implausible, acceleration=known.stuck, pedal_disagree=disagree
        )
    mode_memory, active, faults = modes.supervise(
        memory.modes, inputs, timed_out, lost, streams, pedal, plausibility, p.supervision, dt_s
    )
    mode = mode_memory.mode
    troubles = memory.troubles
    if active != troubles.active and (mode != BrakeMode.INIT or time_s > p.supervision.start_tolerated_s):
        troubles = trouble_codes.remember(troubles, active, time_s, _freeze_frame(memory, inputs, p))

    if math.isfinite(pedal.travel):
        deceleration = base_brake.reference_deceleration(pedal.travel, p.pedal)
        if (
            streams is not ALL_CLEAN and streams[Source.PEDAL].suspect
        ):  # it may be another's: the driver's may be the larger
            deceleration = max(deceleration, *memory.recent_mps2)
        without_pedal_s = 0.0
    else:
        deceleration = memory.deceleration_mps2
        without_pedal_s = memory.without_pedal_s + dt_s
    handed_over = mode == BrakeMode.SAFE_STOP and (
        memory.handed_over or without_pedal_s > p.supervision.demand_hold_s + 0.5 * dt_s
    )
    factor = inputs.blending_factor if math.isfinite(inputs.blending_factor) else memory.blending_factor

    observer, since_sample_s = memory.observer, memory.since_sample_s + dt_s
    if since_sample_s > 0.95 * SAMPLE_S:
        z = estimator.measured(inputs, lost, deceleration, p.motor.torque_per_current_nm_a)
        observer, known = estimator.estimate(observer, z, p, since_sample_s)
        since_sample_s = 0.0
    speeds = _usable_wheel_speeds(inputs, lost, known.implausible)
    mu, charge, torque, motor_nm, pressure = actuate(
        memory.friction, memory.charge, known.pad_friction, known.confidence, known.mass_factor, deceleration, factor,
        max(speeds) if speeds else 0.0, _usable_torque(inputs, lost, mode), ZERO, inputs.charge_power_w, dt_s, p,
    )  # fmt: skip
    m0, m1, m2, m3 = motor_nm
    c0, c1, c2, c3 = known.confidence
    silent = mode == BrakeMode.INIT or handed_over
    outputs = Outputs(
        pressure_demand_pa=UNKNOWN if silent else pressure,
        motor_demand_nm=UNKNOWN if mode == BrakeMode.INIT else (-m0, -m1, -m2, -m3),
        mode=mode,
        faults=faults,
        blending_factor=sum(motor_nm) / torque if torque > 0.0 else 0.0,
        demanded_deceleration_mps2=math.nan if silent else deceleration,
        wheel_torque_nm=known.wheel_torque_nm,
        pad_friction=known.pad_friction,
        confidence=(
            round(CONFIDENCE_STEPS * c0),
            round(CONFIDENCE_STEPS * c1),
            round(CONFIDENCE_STEPS * c2),
            round(CONFIDENCE_STEPS * c3),
        ),
    )
    recent = (deceleration, memory.recent_mps2[0], memory.recent_mps2[1])
    memory = Memory(
        time_s, streams, mode_memory, troubles, disagreement_s, deceleration, recent, without_pedal_s, handed_over,
        factor, charge, observer, since_sample_s, known, mu,
    )  # fmt: skip
    return memory, outputs


def _freeze_frame(memory: Memory, inputs: Inputs, p: EcuParameters) -> trouble_codes.FreezeFrame:
    """The car as it is now, with the mode and the demand of the tick before."""
    speeds = [w for w in inputs.wheel_speed_rad_s if math.isfinite(w)]
    return trouble_codes.FreezeFrame(
        memory.modes.mode,
        max(speeds) * p.vehicle.rolling_radius_m if speeds else math.nan,
        memory.deceleration_mps2,
        (inputs.pedal_1, inputs.pedal_2),
        inputs.pressure_pa,
        inputs.motor_current_a,
    )


def _usable_wheel_speeds(
    inputs: Inputs, lost: tuple[bool, ...], implausible: tuple[bool, bool, bool, bool]
) -> list[float]:
    """Wheel speeds that are present, not timed out and plausible (or all that are there where none is), rad/s."""
    if True not in lost and implausible == estimator.PLAUSIBLE and math.isfinite(sum(inputs.wheel_speed_rad_s)):
        return list(inputs.wheel_speed_rad_s)
    gone = (lost[Source.WHEEL_SPEED_FRONT],) * 2 + (lost[Source.WHEEL_SPEED_REAR],) * 2
    wheels = zip(inputs.wheel_speed_rad_s, gone, implausible, strict=True)
    present = [(w, odd) for w, missing, odd in wheels if math.isfinite(w) and not missing]
    return [w for w, odd in present if not odd] or [w for w, _ in present]


def _usable_torque(inputs: Inputs, lost: tuple[bool, ...], mode: BrakeMode) -> Four:
    """Torque that may be asked of each motor, Nm, positive: none beside a brake that follows its own pedal map."""
    if mode not in (BrakeMode.NORMAL, BrakeMode.DEGRADED) or Brake.OWN_MAP in inputs.brake:
        return ZERO
    if True not in lost and True not in inputs.motor_failed:
        values = inputs.motor_available_nm
        if math.isfinite(sum(values) + sum(inputs.motor_current_a)):
            return values
    gone = (lost[Source.MOTOR_FRONT], lost[Source.MOTOR_FRONT], lost[Source.MOTOR_REAR], lost[Source.MOTOR_REAR])
    a, b, c, d = (
        0.0 if missing or failed or not (math.isfinite(t) and math.isfinite(i)) else t
        for t, i, missing, failed in zip(
            inputs.motor_available_nm, inputs.motor_current_a, gone, inputs.motor_failed, strict=True
        )
    )
    return (a, b, c, d)

"""The control law: one pure step from inputs to outputs.

Pedal -> demanded deceleration -> brake torque of each wheel -> motors and friction -> pressures, under the operating
mode that the supervision allows. Losing an input never releases pressure: what the motors lose goes to the friction
brake, and without any pedal the last demand stands until the brake is asked to follow its own pedal map.
"""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode
from ecu.law import base_brake, blend, estimator, modes, trouble_codes
from ecu.law import pedal as pedal_travel
from ecu.law.actuation import actuate, actuation_parameters
from ecu.law.communication import ALL_CLEAN, Streams, judge_streams
from ecu.law.plausibility import judge
from ecu.law.types import PLAUSIBLE, UNKNOWN, ZERO, Brake, Four, Inputs, Outputs, Source
from ecu.parameters.ecu import EcuParameters

SAMPLE_S = 0.01  # the sensors' cycle: the observer steps once for each, however fast the task
CONFIDENCE_STEPS = 7
_BOTH_FOLLOW = (Brake.DEMAND, Brake.DEMAND)
_NONE = (False, False, False, False)
# every tick asks for these: an enum's attributes are slow, and so is the Python-made __new__ of a NamedTuple
_INIT, _SAFE_STOP, _WITH_MOTORS = BrakeMode.INIT, BrakeMode.SAFE_STOP, (BrakeMode.NORMAL, BrakeMode.DEGRADED)
_PEDAL, _OWN_MAP = Source.PEDAL, Brake.OWN_MAP
_new = tuple.__new__


class Memory(NamedTuple):
    """State of the law between two steps.

    ``time_s``: since the start; ``streams``, ``troubles``: what is held against the received frames, what was found.
    ``deceleration_mps2``: last valid demand, ``recent_mps2``: those of the last ticks; ``without_pedal_s``: time since
    there was one; ``handed_over``: the brake has been asked to follow its own pedal map. ``charge``: what the shares of
    motors and friction count on; ``watch``, ``bits``, ``wheel_speed_rad_s``: state of the plausibility checks, what
    they found, and the fastest wheel that they believe; ``observer``: state of the chosen observer; ``friction``: pad
    friction in use; ``asked_pa``, ``asked_nm``: demands of the last step.
    """

    time_s: float
    streams: Streams
    modes: modes.ModeMemory
    troubles: trouble_codes.TroubleMemory
    pedal: pedal_travel.PedalMemory
    deceleration_mps2: float
    recent_mps2: tuple[float, float, float]
    without_pedal_s: float
    handed_over: bool
    blending_factor: float
    charge: blend.ChargePower
    watch: estimator.Vector
    bits: int
    wheel_speed_rad_s: float
    observer: estimator.Vector
    since_sample_s: float
    estimates: estimator.Estimates
    friction: Four
    asked_pa: Four
    asked_nm: Four


def initial_memory(parameters: EcuParameters) -> Memory:
    """State before the first step."""
    for derived in (estimator.joint_parameters, judge.judge_parameters, actuation_parameters):
        derived(parameters)  # kept beside the set from now on: no work of the first tick
    mu = parameters.friction_brake.pad_friction
    return Memory(
        time_s=0.0,
        streams=ALL_CLEAN,
        modes=modes.initial_modes(),
        troubles=trouble_codes.NO_TROUBLE,
        pedal=pedal_travel.INITIAL,
        deceleration_mps2=0.0,
        recent_mps2=(0.0, 0.0, 0.0),
        without_pedal_s=0.0,
        handed_over=False,
        blending_factor=parameters.blend.blending_factor,
        charge=blend.ChargePower(0.0, 0.0, 0.0),
        watch=judge.initial_state(),
        bits=0,
        wheel_speed_rad_s=0.0,
        observer=estimator.initial_state(parameters),
        since_sample_s=0.0,
        estimates=estimator.Estimates(0.0, UNKNOWN, (mu, mu, mu, mu), ZERO, 1.0),
        friction=(mu, mu, mu, mu),
        asked_pa=UNKNOWN,
        asked_nm=UNKNOWN,
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
    (
        time_s, streams, mode_memory, troubles, pedal_memory, last_deceleration, recent, without_pedal_s, handed_over,
        factor, charge, watch, bits, wheel_speed, observer, since_sample_s, known, mu, asked_pa, asked_nm,
    ) = memory  # fmt: skip
    time_s += dt_s
    timed_out = modes.timed_out_sources(inputs, p.supervision)
    streams = judge_streams(streams, inputs.health, timed_out, p.supervision, dt_s)
    lost = modes.lost_sources(timed_out, streams)
    pedal_memory, pedal = pedal_travel.read_pedal(
        pedal_memory, inputs, lost[_PEDAL], p.supervision, p.plausibility, dt_s
    )
    if math.isfinite(pedal.travel):
        deceleration = base_brake.reference_deceleration(pedal.travel, p.pedal)
        # frames of another's: the driver's may be the larger
        if streams is not ALL_CLEAN and streams[_PEDAL].suspect:
            deceleration = max(deceleration, *recent)
        without_pedal_s = 0.0
    else:
        deceleration = last_deceleration
        without_pedal_s += dt_s
    if math.isfinite(inputs.blending_factor):
        factor = min(max(inputs.blending_factor, 0.0), 1.0)

    since_sample_s += dt_s
    slow, stuck = known.implausible, known.stuck
    if since_sample_s > 0.95 * SAMPLE_S:
        if inputs.brake != _BOTH_FOLLOW:
            asked_pa = _asked_of_followers(asked_pa, inputs.brake)
        z = estimator.measured(inputs, lost, deceleration, asked_pa, asked_nm, p.motor.torque_per_current_nm_a)
        watch, bits, wheel_speed, observer, known = estimator.observe(watch, observer, known, z, p, since_sample_s)
        since_sample_s = 0.0
    plausibility = PLAUSIBLE
    if bits or stuck or slow != estimator.PLAUSIBLE or pedal.channels_disagree or True in pedal.implausible:
        plausibility = judge.plausibility_of(bits, slow, stuck, pedal.implausible, pedal.channels_disagree)
    mode_memory, active, faults = modes.supervise(
        mode_memory, inputs, timed_out, lost, streams, pedal, plausibility, p.supervision, dt_s
    )
    mode = mode_memory.mode
    if active != troubles.active and (mode != _INIT or time_s > p.supervision.start_tolerated_s):
        troubles = trouble_codes.remember(troubles, active, time_s, _freeze_frame(memory, inputs))
    handed_over = mode == _SAFE_STOP and (handed_over or without_pedal_s > p.supervision.demand_hold_s + 0.5 * dt_s)

    if slow != estimator.PLAUSIBLE:
        wheel_speed = _fastest_of(inputs, slow, wheel_speed)
    opposing_nm = ZERO if plausibility.motor_torque == _NONE else judge.opposing_torque(watch)
    mu, charge, torque, motor_nm, pressure = actuate(
        mu, charge, known.pad_friction, known.confidence, known.mass_factor, deceleration, factor,
        wheel_speed, _usable_torque(inputs, lost, mode, plausibility.motor_torque), opposing_nm,
        inputs.charge_power_w, dt_s, p,
    )  # fmt: skip
    m0, m1, m2, m3 = motor_nm
    c0, c1, c2, c3 = known.confidence
    silent = mode == _INIT or handed_over
    pressure_demand = UNKNOWN if silent else pressure
    motor_demand = UNKNOWN if mode == _INIT else (-m0, -m1, -m2, -m3)
    outputs = (
        pressure_demand,
        motor_demand,
        mode,
        faults,
        sum(motor_nm) / torque if torque > 0.0 else 0.0,
        math.nan if silent else deceleration,
        known.wheel_torque_nm,
        known.pad_friction,
        (
            round(CONFIDENCE_STEPS * c0),
            round(CONFIDENCE_STEPS * c1),
            round(CONFIDENCE_STEPS * c2),
            round(CONFIDENCE_STEPS * c3),
        ),
    )
    recent = (deceleration, recent[0], recent[1])
    state = (
        time_s, streams, mode_memory, troubles, pedal_memory, deceleration, recent, without_pedal_s, handed_over,
        factor, charge, watch, bits, wheel_speed, observer, since_sample_s, known, mu, pressure_demand, motor_demand,
    )  # fmt: skip
    return _new(Memory, state), _new(Outputs, outputs)


def asked_instead(
    memory: Memory, outputs: Outputs, pressure_demand_pa: Four, motor_demand_nm: Four
) -> tuple[Memory, Outputs]:
    """State and outputs after a step whose demands another one has replaced: what comes is held against these."""
    memory = memory._replace(asked_pa=pressure_demand_pa, asked_nm=motor_demand_nm)
    return memory, outputs._replace(pressure_demand_pa=pressure_demand_pa, motor_demand_nm=motor_demand_nm)


def _freeze_frame(memory: Memory, inputs: Inputs) -> trouble_codes.FreezeFrame:
    """The car as it is now, with mode, speed and demand of the tick before."""
    return trouble_codes.FreezeFrame(
        memory.modes.mode,
        memory.estimates.speed_mps,
        memory.deceleration_mps2,
        (inputs.pedal_1, inputs.pedal_2),
        inputs.pressure_pa,
        inputs.motor_current_a,
    )


def _asked_of_followers(asked_pa: Four, brake: tuple[Brake, Brake]) -> Four:
    """Pressures that were asked, NaN of an axle that does not follow."""
    front, rear = brake[0] == Brake.DEMAND, brake[1] == Brake.DEMAND
    a, b, c, d = asked_pa
    nan = math.nan
    return (a if front else nan, b if front else nan, c if rear else nan, d if rear else nan)


def _fastest_of(inputs: Inputs, implausible: tuple[bool, bool, bool, bool], most: float) -> float:
    """Speed of the fastest wheel, rad/s, without those that are implausible, at most what was believed with them."""
    wheels = zip(inputs.wheel_speed_rad_s, implausible, strict=True)
    speeds = [w for w, odd in wheels if not odd and 0.0 <= w <= most]
    return max(speeds) if speeds else most


def _usable_torque(
    inputs: Inputs, lost: tuple[bool, ...], mode: BrakeMode, excluded: tuple[bool, bool, bool, bool]
) -> Four:
    """Torque that may be asked of each motor, Nm, positive: none beside a brake that follows its own pedal map."""
    if mode not in _WITH_MOTORS or _OWN_MAP in inputs.brake:
        return ZERO
    values = inputs.motor_available_nm
    well = True not in lost and True not in inputs.motor_failed and excluded == _NONE and min(values) >= 0.0
    if well and math.isfinite(sum(values) + sum(inputs.motor_current_a)):
        return values
    gone = (lost[Source.MOTOR_FRONT], lost[Source.MOTOR_FRONT], lost[Source.MOTOR_REAR], lost[Source.MOTOR_REAR])
    a, b, c, d = (
        0.0 if missing or failed or out or not (math.isfinite(t) and math.isfinite(i)) else max(t, 0.0)
        for t, i, missing, failed, out in zip(
            values, inputs.motor_current_a, gone, inputs.motor_failed, excluded, strict=True
        )
    )
    return (a, b, c, d)

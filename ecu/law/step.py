"""The control law: one pure step from inputs to outputs.

Pedal -> demanded deceleration -> brake torque of each wheel -> motors and friction -> pressures, under the operating
mode that the supervision allows. Losing an input never releases pressure: what the motors lose goes to the friction
brake, and without any pedal the last demand stands until the brake is asked to follow its own pedal map.
"""

import math
from typing import NamedTuple

from dbc.messages import BrakeMode
from ecu.law import base_brake, blend, estimates, friction, modes
from ecu.law.types import ZERO, Brake, Four, Inputs, Outputs, Source
from ecu.parameters.ecu import EcuParameters

NOT_AVAILABLE: Four = (math.nan, math.nan, math.nan, math.nan)


class Memory(NamedTuple):
    """State of the law between two steps.

    ``deceleration_mps2``: last valid demand; ``without_pedal_s``: time since there was one; ``handed_over``: the brake
    has been asked to follow its own pedal map.
    """

    modes: modes.ModeMemory
    deceleration_mps2: float
    without_pedal_s: float
    handed_over: bool
    blending_factor: float


def initial_memory(parameters: EcuParameters) -> Memory:
    """State before the first step."""
    return Memory(modes.initial_modes(), 0.0, 0.0, False, parameters.blend.blending_factor)


def step(memory: Memory, inputs: Inputs, parameters: EcuParameters, dt_s: float) -> tuple[Memory, Outputs]:
    """Advance the control law by one tick.

    Parameters
    ----------
    memory : state after the last step; not changed.
    inputs : what the sensors say now.
    dt_s : time since the last step.
    """
    p = parameters
    lost = modes.lost_sources(inputs, p.supervision)
    pedal = base_brake.read_pedal(inputs, lost[Source.PEDAL], p.supervision.pedal_disagreement)
    mode_memory, faults = modes.supervise(memory.modes, inputs, lost, pedal, p.supervision, dt_s)
    mode = mode_memory.mode

    if math.isfinite(pedal.travel):
        deceleration = base_brake.reference_deceleration(pedal.travel, p.pedal)
        without_pedal_s = 0.0
    else:
        deceleration = memory.deceleration_mps2
        without_pedal_s = memory.without_pedal_s + dt_s
    handed_over = mode == BrakeMode.SAFE_STOP and (
        memory.handed_over or without_pedal_s > p.supervision.demand_hold_s + 0.5 * dt_s
    )
    factor = inputs.blending_factor if math.isfinite(inputs.blending_factor) else memory.blending_factor

    speeds = estimates.usable_wheel_speeds(inputs, lost)
    wheel_speed = max(speeds) if speeds else 0.0
    speed = max(wheel_speed * p.vehicle.rolling_radius_m, 0.0)
    resistance = base_brake.driving_resistance(speed, p.vehicle.mass_kg, p.vehicle)
    resistance *= min(deceleration / p.pedal.resistance_full_mps2, 1.0)
    torque = base_brake.brake_torque(deceleration, resistance, p.vehicle.mass_kg, p.vehicle)
    demand = base_brake.distribute(torque, p.friction_brake.front_share)
    shares = blend.blend(
        demand,
        factor,
        _usable_torque(inputs, lost, mode),
        inputs.charge_power_w,
        speed,
        wheel_speed,
        deceleration,
        p.blend,
        p.motor,
    )

    gain = friction.gains(p.friction_brake)
    mu = p.friction_brake.pad_friction
    q0, q1, q2, q3 = (
        friction.pressure_demand(t, mu, g, p.friction_brake) for t, g in zip(shares.friction_nm, gain, strict=True)
    )
    m0, m1, m2, m3 = shares.motor_nm
    silent = mode == BrakeMode.INIT or handed_over
    outputs = Outputs(
        pressure_demand_pa=NOT_AVAILABLE if silent else (q0, q1, q2, q3),
        motor_demand_nm=NOT_AVAILABLE if mode == BrakeMode.INIT else (-m0, -m1, -m2, -m3),
        mode=mode,
        faults=faults,
        blending_factor=sum(shares.motor_nm) / torque if torque > 0.0 else 0.0,
        demanded_deceleration_mps2=math.nan if silent else deceleration,
        wheel_torque_nm=estimates.nominal_wheel_torque(
            inputs.pressure_pa, estimates.motor_torques(inputs.motor_current_a, p.motor), mu, gain, p.friction_brake
        ),
        pad_friction=(mu, mu, mu, mu),
        confidence=(0, 0, 0, 0),
    )
    return Memory(mode_memory, deceleration, without_pedal_s, handed_over, factor), outputs


def _usable_torque(inputs: Inputs, lost: tuple[bool, ...], mode: BrakeMode) -> Four:
    """Torque that may be asked of each motor, Nm, positive: none beside a brake that follows its own pedal map."""
    if mode not in (BrakeMode.NORMAL, BrakeMode.DEGRADED) or Brake.OWN_MAP in inputs.brake:
        return ZERO
    gone = (lost[Source.MOTOR_FRONT], lost[Source.MOTOR_FRONT], lost[Source.MOTOR_REAR], lost[Source.MOTOR_REAR])
    a, b, c, d = (
        0.0 if missing or failed or not (math.isfinite(t) and math.isfinite(i)) else t
        for t, i, missing, failed in zip(
            inputs.motor_available_nm, inputs.motor_current_a, gone, inputs.motor_failed, strict=True
        )
    )
    return (a, b, c, d)

"""From the demanded deceleration to what motors and brakes are asked for, in one compiled call."""

from functools import lru_cache
from typing import Any, NamedTuple

from ecu.law import base_brake, blend, compensation, friction
from ecu.law.compiled import entry, record
from ecu.law.types import Four
from ecu.parameters.ecu import EcuParameters

_friction_in_use, _motor_factor = compensation.friction_in_use, compensation.motor_factor
_driving_resistance, _brake_torque, _distribute = (
    base_brake.driving_resistance, base_brake.brake_torque, base_brake.distribute,
)  # fmt: skip
_wanted_torque, _ramp_charge_limit, _blend = blend.wanted_torque, blend.ramp_charge_limit, blend.blend
_pressure_demands = friction.pressure_demands


class Actuation(NamedTuple):
    """What is asked for.

    ``friction``: pad friction in use; ``charge``: what the shares count on; ``torque_nm`` of all wheels together,
    ``motor_nm`` the motors' part of each, positive braking; ``pressure_pa`` of each wheel.
    """

    friction: Four
    charge: blend.ChargePower
    torque_nm: float
    motor_nm: Four
    pressure_pa: Four


@entry
def _actuate(
    used: Four, held: blend.ChargePower, pad_friction: Four, confidence: Four, mass_factor: float, deceleration: float,
    factor: float, wheel_speed: float, usable: Four, opposing: Four, announced_w: float, dt: float, gains: Four,
    vehicle: Any, brake: Any, motor: Any, pedal: Any, sharing: Any, learning: Any,
) -> tuple[Four, tuple[float, float, float], float, Four, Four]:  # fmt: skip
    v, b, m, s, c = vehicle[0], brake[0], motor[0], sharing[0], learning[0]
    mu = _friction_in_use(used, pad_friction, confidence, b.pad_friction, c, dt)
    mass = v.mass_kg * mass_factor
    speed = max(wheel_speed * v.rolling_radius_m, 0.0)
    resistance = _driving_resistance(speed, mass, v) * min(deceleration / pedal[0].resistance_full_mps2, 1.0)
    torque = _brake_torque(deceleration, resistance, mass, v)
    demand = _distribute(torque, b.front_share)
    wanted = _wanted_torque(demand, _motor_factor(factor, mu, b.pad_friction, c), usable, m)
    power = sum(wanted) * max(wheel_speed, 0.0) * m.charge_efficiency
    charge = _ramp_charge_limit(held, announced_w, power, s, dt)
    shares = _blend(demand, wanted, power, charge, speed, deceleration, s)
    f0, f1, f2, f3 = shares.friction_nm
    if torque > 0.0:
        f0, f1, f2, f3 = f0 + opposing[0], f1 + opposing[1], f2 + opposing[2], f3 + opposing[3]
    pressure = _pressure_demands((f0, f1, f2, f3), mu, gains, b)
    return mu, (charge.soon_w, charge.built_w, charge.now_w), torque, shares.motor_nm, pressure


@lru_cache(maxsize=16)
def _numbers(p: EcuParameters) -> tuple[Any, ...]:
    sets = p.vehicle, p.friction_brake, p.motor, p.pedal, p.blend, p.compensation
    return friction.gains(p.friction_brake), *map(record, sets)


def actuate(
    used: Four, held: blend.ChargePower, pad_friction: Four, confidence: Four, mass_factor: float,
    deceleration_mps2: float, factor: float, wheel_speed_rad_s: float, usable_nm: Four, opposing_nm: Four,
    announced_w: float, dt_s: float, parameters: EcuParameters,
) -> Actuation:  # fmt: skip
    """Share a demanded deceleration between motors and friction brakes.

    Parameters
    ----------
    used, held : pad friction in use and charge power counted on in the last step.
    pad_friction, confidence, mass_factor : estimates.
    factor : blending factor.  wheel_speed_rad_s : of the fastest wheel that is believed.
    usable_nm : torque that may be asked of each motor.  opposing_nm : with which each motor drives against the brake.
    announced_w : charge power that the battery accepts.  dt_s : time since the last step.
    """
    mu, charge, torque_nm, motor_nm, pressure_pa = _actuate(
        used, held, pad_friction, confidence, mass_factor, deceleration_mps2, factor, wheel_speed_rad_s, usable_nm,
        opposing_nm, announced_w, dt_s, *_numbers(parameters),
    )  # fmt: skip
    return Actuation(mu, blend.ChargePower(*charge), torque_nm, motor_nm, pressure_pa)

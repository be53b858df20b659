"""From the demanded deceleration to what motors and brakes are asked for, in one compiled call."""

from functools import lru_cache
from itertools import accumulate
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ecu.law import base_brake, blend, compensation, friction
from ecu.law.compiled import entry, helper, numbers, record_of
from ecu.law.types import Four
from ecu.parameters.control import BlendParameters, PedalParameters
from ecu.parameters.ecu import EcuParameters
from ecu.parameters.observer import CompensationParameters
from ecu.parameters.vehicle import FrictionBrakeParameters, MotorParameters, VehicleParameters

Vector = NDArray[np.float64]

_friction_in_use, _motor_factor = compensation.friction_in_use, compensation.motor_factor
_driving_resistance, _brake_torque, _distribute = (
    base_brake.driving_resistance, base_brake.brake_torque, base_brake.distribute,
)  # fmt: skip
_wanted_torque, _ramp_charge_limit, _blend = blend.wanted_torque, blend.ramp_charge_limit, blend.blend
_pressure_demands, _ChargePower = friction.pressure_demands, blend.ChargePower
_new = tuple.__new__  # without the Python-made one of a NamedTuple


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


# one vector goes to the compiled function, because that is what costs least: what is asked, replaced by what follows
_USED, _HELD, _PAD, _CONFIDENCE, _USABLE, _OPPOSING, _MASS = 0, 4, 7, 11, 15, 19, 23
_DECELERATION, _FACTOR, _WHEEL_SPEED, _ANNOUNCED, _DT, _ASKED = range(_MASS + 1, _MASS + 7)
_PACK = Struct(f"{_ASKED}d").pack
_MU, _CHARGE, _TORQUE, _MOTOR, _PRESSURE, _GIVEN = 0, 4, 7, 8, 12, 16
_UNPACK = Struct(f"{_GIVEN}d").unpack_from

_VEHICLE, _BRAKE, _MOTORS = record_of(VehicleParameters), record_of(FrictionBrakeParameters), record_of(MotorParameters)
_PEDAL, _SHARING, _LEARNING = record_of(PedalParameters), record_of(BlendParameters), record_of(CompensationParameters)
_GAINS = 4
_V, _B, _M, _P, _S, _C, _END = accumulate(
    (len(kind.names or ()) for kind in (_VEHICLE, _BRAKE, _MOTORS, _PEDAL, _SHARING, _LEARNING)), initial=_GAINS
)


@helper
def _four(z: Vector, at: int) -> Four:
    return (z[at], z[at + 1], z[at + 2], z[at + 3])


@entry
def _actuate(z: Vector, p: Vector) -> None:
    v, b, m = p[_V:_B].view(_VEHICLE)[0], p[_B:_M].view(_BRAKE)[0], p[_M:_P].view(_MOTORS)[0]
    pedal, s, c = p[_P:_S].view(_PEDAL)[0], p[_S:_C].view(_SHARING)[0], p[_C:_END].view(_LEARNING)[0]
    deceleration, wheel_speed, opposing, dt = z[_DECELERATION], z[_WHEEL_SPEED], _four(z, _OPPOSING), z[_DT]
    mu = _friction_in_use(_four(z, _USED), _four(z, _PAD), _four(z, _CONFIDENCE), b.pad_friction, c, dt)
    mass = v.mass_kg * z[_MASS]
    speed = max(wheel_speed * v.rolling_radius_m, 0.0)
    resistance = _driving_resistance(speed, mass, v) * min(deceleration / pedal.resistance_full_mps2, 1.0)
    torque = _brake_torque(deceleration, resistance, mass, v)
    demand = _distribute(torque, b.front_share)
    wanted = _wanted_torque(demand, _motor_factor(z[_FACTOR], mu, b.pad_friction, c), _four(z, _USABLE), m)
    w0, w1, w2, w3 = wanted  # no sum(): uncompiled it compensates from Python 3.12 on
    power = (w0 + w1 + w2 + w3) * max(wheel_speed, 0.0) * m.charge_efficiency
    held = _ChargePower(z[_HELD], z[_HELD + 1], z[_HELD + 2])
    charge = _ramp_charge_limit(held, z[_ANNOUNCED], power, s, dt)
    shares = _blend(demand, wanted, power, charge, speed, deceleration, s)
    f0, f1, f2, f3 = shares.friction_nm
    if torque > 0.0:
        f0, f1, f2, f3 = f0 + opposing[0], f1 + opposing[1], f2 + opposing[2], f3 + opposing[3]
    pressure = _pressure_demands((f0, f1, f2, f3), mu, _four(p, 0), b)
    z[_CHARGE], z[_CHARGE + 1], z[_CHARGE + 2], z[_TORQUE] = charge.soon_w, charge.built_w, charge.now_w, torque
    for i in range(4):
        z[_MU + i], z[_MOTOR + i], z[_PRESSURE + i] = mu[i], shares.motor_nm[i], pressure[i]


@lru_cache(maxsize=16)
def actuation_parameters(p: EcuParameters) -> Vector:
    """Parameter vector of the actuation."""
    sets = p.vehicle, p.friction_brake, p.motor, p.pedal, p.blend, p.compensation
    return np.array([*friction.gains(p.friction_brake), *(number for one in sets for number in numbers(one))])


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
    z = bytearray(
        _PACK(
            *used, *held, *pad_friction, *confidence, *usable_nm, *opposing_nm,
            mass_factor, deceleration_mps2, factor, wheel_speed_rad_s, announced_w, dt_s,
        )
    )  # fmt: skip
    _actuate(np.frombuffer(z), actuation_parameters(parameters))
    a, b, c, d, soon, built, now, torque_nm, e, f, g, h, i, j, k, m = _UNPACK(z)
    charge = _new(blend.ChargePower, (soon, built, now))
    return _new(Actuation, ((a, b, c, d), charge, torque_nm, (e, f, g, h), (i, j, k, m)))

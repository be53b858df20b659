"""Internal quantities of the law, for reading one by one and periodically: their order gives their identifiers."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from ecu.diagnostics.exchange import View

WHEELS = ("fl", "fr", "rl", "rr")
TICK_S = 0.01  # one count of a record's first byte


class Quantity(NamedTuple):
    """A number that the law knows; ``read`` takes it out of a view, NaN where it is not known."""

    name: str
    unit: str
    read: Callable[[View], float]


def _of_wheels(name: str, unit: str, read: Callable[[View, int], float]) -> list[Quantity]:
    def of_wheel(i: int) -> Callable[[View], float]:
        return lambda v: read(v, i)

    return [Quantity(f"{name}_{wheel}", unit, of_wheel(i)) for i, wheel in enumerate(WHEELS)]


QUANTITIES: tuple[Quantity, ...] = (
    Quantity("time", "s", lambda v: v.time_s),
    Quantity("mode", "1", lambda v: v.outputs.mode),
    Quantity("active_faults", "1", lambda v: v.outputs.faults),
    Quantity("active_codes", "1", lambda v: v.troubles.active.bit_count()),
    Quantity("demanded_deceleration", "m/s2", lambda v: v.outputs.demanded_deceleration_mps2),
    Quantity("blending_factor", "1", lambda v: v.outputs.blending_factor),
    Quantity("speed", "m/s", lambda v: v.estimates.speed_mps),
    Quantity("mass_factor", "1", lambda v: v.estimates.mass_factor),
    Quantity("expected_acceleration", "m/s2", lambda v: v.estimates.expected_mps2),
    Quantity("grade_acceleration", "m/s2", lambda v: v.estimates.grade_mps2),
    Quantity("pedal_travel_1", "1", lambda v: v.inputs.pedal_1),
    Quantity("pedal_travel_2", "1", lambda v: v.inputs.pedal_2),
    Quantity("longitudinal_acceleration", "m/s2", lambda v: v.inputs.acceleration_x_mps2),
    Quantity("lateral_acceleration", "m/s2", lambda v: v.inputs.acceleration_y_mps2),
    Quantity("yaw_rate", "rad/s", lambda v: v.inputs.yaw_rate_rad_s),
    Quantity("steering_wheel_angle", "rad", lambda v: v.inputs.steering_wheel_angle_rad),
    Quantity("charge_power", "W", lambda v: v.inputs.charge_power_w),
    *_of_wheels("wheel_speed", "rad/s", lambda v, i: v.inputs.wheel_speed_rad_s[i]),
    *_of_wheels("pressure", "Pa", lambda v, i: v.inputs.pressure_pa[i]),
    *_of_wheels("pressure_demand", "Pa", lambda v, i: v.outputs.pressure_demand_pa[i]),
    *_of_wheels("motor_current", "A", lambda v, i: v.inputs.motor_current_a[i]),
    *_of_wheels("motor_available", "Nm", lambda v, i: v.inputs.motor_available_nm[i]),
    *_of_wheels("motor_demand", "Nm", lambda v, i: v.outputs.motor_demand_nm[i]),
    *_of_wheels("wheel_torque", "Nm", lambda v, i: v.estimates.wheel_torque_nm[i]),
    *_of_wheels("pad_friction", "1", lambda v, i: v.estimates.pad_friction[i]),
    *_of_wheels("confidence", "1", lambda v, i: v.estimates.confidence[i]),
    *_of_wheels("friction_in_use", "1", lambda v, i: v.friction[i]),
)
RECORD_BYTES = 5


def record(quantity: Quantity, view: View) -> bytes:
    """The law's tick number (its low byte), so that missing samples show, and the value as a 32-bit float."""
    return struct.pack(">Bf", round(view.time_s / TICK_S) & 0xFF, quantity.read(view))

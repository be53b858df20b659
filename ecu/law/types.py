"""Values that enter and leave the control law. Wheel order fl, fr, rl, rr; NaN means not available."""

import math
from enum import IntEnum
from typing import NamedTuple

from dbc.messages import BrakeMode, Fault

Four = tuple[float, float, float, float]

ZERO: Four = (0.0, 0.0, 0.0, 0.0)
UNKNOWN: Four = (math.nan, math.nan, math.nan, math.nan)


class Source(IntEnum):
    """Where the law's inputs come from; each can be lost on its own."""

    PEDAL = 0
    WHEEL_SPEED_FRONT = 1
    WHEEL_SPEED_REAR = 2
    BODY_MOTION = 3
    EHB_PRESSURE_FRONT = 4
    EHB_PRESSURE_REAR = 5
    MOTOR_FRONT = 6
    MOTOR_REAR = 7
    STEERING = 8
    BATTERY = 9


class Health(NamedTuple):
    """Supply of one source at a tick.

    ``age_s``: time since its last usable values; ``fresh``: some came now; ``bad_in_row``: unusable frames in a row.
    Frames of this tick: ``bad`` with a wrong check value or old bytes, ``foreign`` that the source cannot have sent,
    ``doubled``.
    """

    age_s: float
    fresh: bool
    bad_in_row: int
    bad: int = 0
    foreign: int = 0
    doubled: int = 0


WELL = Health(0.0, True, 0)
OTHERS_WELL = (WELL,) * (len(Source) - 1)
"""Health of all sources but the slow one, the battery, which is the last: compared at once, it is mostly this."""


class Brake(IntEnum):
    """What the pressure control of an axle follows."""

    DEMAND = 0
    OWN_MAP = 1
    FAILED = 2


class Inputs(NamedTuple):
    """What the sensors say at one tick; the last values of a lost source may still stand here."""

    pedal_1: float
    pedal_2: float
    wheel_speed_rad_s: Four
    acceleration_x_mps2: float
    acceleration_y_mps2: float
    yaw_rate_rad_s: float
    pressure_pa: Four
    brake: tuple[Brake, Brake]
    motor_current_a: Four
    motor_available_nm: Four
    motor_failed: tuple[bool, bool, bool, bool]
    steering_wheel_angle_rad: float
    charge_power_w: float
    blending_factor: float
    link_down: bool
    health: tuple[Health, ...]


class Plausibility(NamedTuple):
    """What does not agree with the rest, debounced: each wheel, each pedal channel, the acceleration sensor."""

    wheel_speed: tuple[bool, bool, bool, bool]
    pressure: tuple[bool, bool, bool, bool]
    motor_torque: tuple[bool, bool, bool, bool]  # demanded against reported torque
    pedal: tuple[bool, bool]
    pedal_disagree: bool
    acceleration: bool


PLAUSIBLE = Plausibility((False,) * 4, (False,) * 4, (False,) * 4, (False, False), False, False)


class Outputs(NamedTuple):
    """Demands and reports of one tick; NaN is sent as not available."""

    pressure_demand_pa: Four
    motor_demand_nm: Four
    mode: BrakeMode
    faults: Fault
    blending_factor: float
    demanded_deceleration_mps2: float
    wheel_torque_nm: Four
    pad_friction: Four
    confidence: tuple[int, int, int, int]

"""When something in the car can show: nothing a brake does shows while the brakes are released.

Takes names of injection points and of numbers of the parameter set, gives what must be going on for them to matter.
The tables follow from sensitivities over a whole set of drives: what they leave out holds less than a hundredth of the
information on a number.
"""

from enum import IntFlag

from plant.injection_points import INJECTION_POINTS


class Excitation(IntFlag):
    """What goes on in a part of a drive, or has to for something to change how the car moves in it."""

    NONE = 0  # the motion never changes: only what sensors tell of it
    BRAKES = 1  # pressure, or a demand for it
    MOTORS = 2  # torque of the motors, or a demand for it
    TURNING = 4
    ALWAYS = 8
    MOVING = 16  # a car that stands, pulled by no motor, says nothing of its tyres, wheels, springs and masses


AT_POINT = {
    "friction.mu": Excitation.BRAKES, "brake.pressure": Excitation.BRAKES, "brake.torque": Excitation.BRAKES,
    "hydraulics.rate": Excitation.BRAKES, "hydraulics.demand": Excitation.BRAKES, "motor.demand": Excitation.MOTORS,
    "motor.available": Excitation.MOTORS, "motor.torque": Excitation.MOTORS, "tyre.stiffness": Excitation.MOVING,
    "road.friction": Excitation.MOVING, "wheel.radius": Excitation.MOVING, "wheel.rolling_torque": Excitation.MOVING,
    "contact.speed": Excitation.MOVING, "steering.angle": Excitation.MOVING,
}  # fmt: skip
"""Of injection points; all others act always."""
_OF_SECTION = {
    "ehb_": Excitation.BRAKES, "friction_brake_": Excitation.BRAKES, "pad_": Excitation.BRAKES,
    "motor_": Excitation.MOTORS, "battery_": Excitation.MOTORS,
}  # fmt: skip
_LATERAL = (
    "tyre_lky", "tyre_lmuy", "vehicle_steering_ratio", "vehicle_yaw_inertia_kg_m2", "suspension_anti_roll_nm_rad",
    "suspension_roll_centre_height_m", "vehicle_slip_angle_share", "tyre_pky2",
)  # fmt: skip


def of_parameter(name: str) -> Excitation:
    """What must be going on for a number of the parameter set (``PARAMETER``) to matter."""
    if name in _LATERAL:
        return Excitation.TURNING
    return next((when for start, when in _OF_SECTION.items() if name.startswith(start)), Excitation.MOVING)


def of_point(name: str) -> Excitation:
    """What must be going on for an injection point to matter, one of the model's or a number of the parameter set."""
    return AT_POINT.get(name, Excitation.ALWAYS) if name in INJECTION_POINTS else of_parameter(name)

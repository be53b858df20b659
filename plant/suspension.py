"""Vertical force of one corner: spring, damper, anti-roll bar and the support of the links."""

from plant.compiled import equation


@equation
def spring_force(
    compression_m: float, rate_mps: float, roll_rad: float, y_m: float, stiffness: float, progression: float,
    damping: float, anti_roll: float,
) -> float:  # fmt: skip
    """Force that spring, damper and anti-roll bar add to the static load, N, positive up on the body.

    Parameters
    ----------
    compression_m, rate_mps : spring travel from the static position and its rate.  y_m : wheel position, left positive.
    stiffness, progression : linear (N/m) and cubic (N/m3) spring rate.  damping : N s/m.
    anti_roll : N m/rad for the axle.
    """
    spring = (stiffness + progression * compression_m * compression_m) * compression_m
    return spring + damping * rate_mps - 0.5 * anti_roll * roll_rad / y_m


@equation
def link_force(
    brake_force_n: float, drive_force_n: float, axle_lateral_n: float, front: float, y_m: float, brake_tangent: float,
    drive_tangent: float, roll_centre_m: float,
) -> float:  # fmt: skip
    """Force the links pass by the spring, N, positive up on the body.

    Reimpell/Stoll/Betzler, The Automotive Chassis, chapter 3. The forces are those the torques and the steady turn
    imply (T/R, m v r), not the tyre's own: those depend on the load, which would close an algebraic loop.

    Parameters
    ----------
    brake_force_n, drive_force_n : torque of the friction brake and of the motor over radius; negative brakes.
    axle_lateral_n : lateral force of the axle.  front : 1 front, -1 rear.
    brake_tangent, drive_tangent : slope of the line to the support pole from the contact, of motors on the body from
        the wheel's centre; braking lifts the body at the front and pulls it down at the rear.
    roll_centre_m : height of the roll centre.
    """
    supported = brake_tangent * brake_force_n + drive_tangent * drive_force_n
    return -front * supported - 0.5 * axle_lateral_n * roll_centre_m / y_m

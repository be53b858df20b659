"""Where each number lies in the flat vectors of the plausibility checks: state, parameters, bits of the verdict."""

# state
WHEEL_LEVEL, PRESSURE_LEVEL, MOTOR_LEVEL, ACCELERATION_LEVEL = 0, 4, 8, 12  # of the up-down counters, s
WHEEL_LAST = 13  # speed of each wheel as far as a wheel can follow
PRESSURE_LOW, PRESSURE_HIGH = 17, 21  # between which a brake that follows its demands can be
MOTOR_LOW, MOTOR_HIGH = 25, 29  # the same of the motors
EXCLUDED_S = 33  # time until a motor is tried again
OPPOSING = 37  # torque of a motor that drives while it should not, Nm
ASKED_S = 41  # for how long the motors have had demands
BEGUN, LAST_SPEED = 42, 43  # whether there was a sample, and the car's speed by the wheels then
BODY, WHEELS, FORCES = 44, 45, 46  # accelerations by the sensor, the wheels and the force balance, smoothed
LAST_AX, BEFORE_AX = 47, 48
REPORTED = 49  # how much better the reported torque of excluded motors explains the acceleration, m/s2
SIZE = 50

# parameters
(
    FORGET, HEAL_S, RADIUS, MASS, ARM, WHEEL_S, FALL, RISE, ABOVE, ABOVE_MPS, SPEED_MAX, PRESSURE_S, PRESSURE_PA,
    PRESSURE_SHARE, PRESSURE_LAG_S, MOTOR_S, MOTOR_NM, MOTOR_SHARE, MOTOR_LAG_S, MOTOR_RATE, START_S, RETRY_S,
    ACCELERATION_S, ACCELERATION, ACCELERATION_SHARE, ACCELERATION_LAG_S, JUMP, ROUGH, MOTOR_MAX,
) = range(29)  # fmt: skip

# bits of the verdict, wheels fl, fr, rl, rr
WHEEL_BIT, PRESSURE_BIT, MOTOR_BIT, ACCELERATION_BIT = 0, 4, 8, 12

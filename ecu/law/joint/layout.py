"""Where each number lies in the flat vectors of the joint filter: state, inputs, parameters."""

# estimated states
SPEED, BIAS, GRADE, MASS, STIFFNESS, AXLE = 0, 1, 2, 3, 4, 5
RADIUS, FRICTION = 6, 10
N = 14
# vector of the whole state: estimates, covariance, then what is merely remembered
COVARIANCE = N
PRESSURE_ZERO = N + N * N
PRESSURE_LAG = PRESSURE_ZERO + 4
MOTOR_LAG = PRESSURE_LAG + 4
SLIDING = MOTOR_LAG + 4  # seconds that a wheel still counts as sliding
TORQUE = SLIDING + 4
LOCKED = TORQUE + 4  # seconds that a wheel has stood while the car moves
LAST_WHEEL = LOCKED + 4
SPIN = LAST_WHEEL + 4  # speed and rate with which a wheel spins down
SPIN_RATE = SPIN + 4
SLID_S = SPIN_RATE + 4  # how long a wheel has been sliding by now
PITCH, PITCH_RATE, LOAD_ACCELERATION, FORCE_LAG, RELEASED_S, STARTED, REJECTED_S = (SLID_S + 4 + i for i in range(7))
LAST_AX = SLID_S + 11  # for how long it has repeated itself, when that was last looked at and the wheels' speed then
REPEATED_S, LOOKED_S, SPEED_THEN, STUCK = LAST_AX + 1, LAST_AX + 2, LAST_AX + 3, LAST_AX + 4
ODD_S = LAST_AX + 5  # how long a wheel has been sliding alone or with one other, less than it has rolled since
EXPECTED = ODD_S + 4  # what the accelerometer should show by the wheels' torques, m/s2
SIZE = EXPECTED + 1

# inputs
AX, AY, YAW_RATE, STEER, DEMAND = 0, 1, 2, 3, 4
WHEEL, PRESSURE, MOTOR = 5, 9, 13
AVAILABLE, ASKED_PRESSURE, ASKED_MOTOR = 17, 21, 25  # of the actuators; used by the plausibility checks only
HOLD = 29  # above 0: some value stands in for one that is missing or wrong, nothing may be learned from the sample
INPUTS = 30

# parameters
(P_MASS, P_BASE, P_FRONT, P_HEIGHT, P_RADIUS, P_ARM, P_INERTIA, P_DRAG, P_ROLL, P_DIVE, P_STEER_RATIO) = range(11)
P_TRACK, P_GAIN = 11, 13
P_THRESHOLD, P_STIFF, P_STIFF_SLOPE, P_PEAK, P_CORNER, P_RELAX = range(15, 21)
P_LAG, P_WHEEL_LAG, P_PITCH_W, P_PITCH_D, P_ZERO_TIME, P_ZERO_LIMIT, P_SPEED_MIN, P_SLIDE, P_TOOTH = range(21, 30)
(Q_BIAS, Q_GRADE, Q_STIFF, Q_COMMON, Q_AXLE, Q_SINGLE, Q_RELEASED, R_ACC, R_ALIGN, R_WHEEL, GATE, ROAD) = range(30, 42)
START = 42  # variances: bias, grade, mass, stiffness, axle, radius, friction common, axle, single; nominal friction
PARAMETERS = 52

APPLIED_PA = 1e5

"""Every constant that decides whether a sensor, a radius or a brake is named in the comparison of sensors.

Each states what it is, its unit and where it comes from. A change here changes answers: the record in ``tests/pinned``
is made anew and the real cars (``tests/measured``) are measured again.
"""

THRESHOLD = 20.0
"""Detection threshold, of the gain in -2 log likelihood: noise passes it once in 100,000 tests of a true model."""
CONVERGE_SHARE = 0.5
"""Share of the threshold from which a fit of a few iterations is converged: it may gain more then."""
ALPHA = 0.003
"""Probability at which a parameter of nominal value is called significant, two-sided."""
RARE = 0.01
"""Relative likelihood below which a rival is not reported."""
INDISTINGUISHABLE = 4.6
"""Difference in -2 log likelihood (a Bayes factor of ten) below which two explanations are not distinguished."""
IMU_SCALE, MAX_SENSOR_SCALE = 0.04, 0.2
"""Typical scale error of an accelerometer, and the largest that still counts as one of the sensor."""
ROLL = 0.15
"""Scale error of a lateral accelerometer by the body's roll, standard deviation (effects, 56)."""
DIVE = 0.02
"""Likewise of a longitudinal one by dive, which is 1 to 1.5 deg/g (effects, 8)."""
TRACK = 0.03
"""Relative standard deviation of the track width."""
MIN_STOPS = 3
"""Stops that the brake's parameters are estimated from at least."""
SPREAD = 0.002
"""Spread of rolling radii between wheels that no tolerance states, relative: 0.12 % on comma2k19 (effects, 13)."""

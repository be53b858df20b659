"""From logs without measured forces and a nominal vehicle to errors of sensors, found in the car's own motion.

In: logs and the vehicle set. Out: the answer of `explain` (causes, rivals, held-out errors) and the estimates that the
stops support. Four state-space models (`longitudinal`, `lateral`, `wheel_radius`, `braking`) share one Kalman filter;
`selection` adds the parameters that the data need, `labels` maps them to effects.
"""

"""IMU zero off and drifting."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """a' = a + b + d t, r' = r + b_r."""
    drifted = number["ax_mps2"][:, 0] + number["drift_mps3"][:, 0] * time_s
    return values + np.column_stack([drifted, number["ay_mps2"][:, 0], number["yaw_rate_rad_s"][:, 0]])


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    drifted = number["ax_mps2"][:, 0] + number["drift_mps3"][:, 0] * time_s
    return values - np.column_stack([drifted, number["ay_mps2"][:, 0], number["yaw_rate_rad_s"][:, 0]])


EFFECT = Effect(
    name="imu_bias",
    row=55,
    title="IMU zero off and drifting",
    equation="a' = a + b + d t, r' = r + b_r",
    injection_points=("sensor.imu",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(
        Parameter("ax_mps2", "m/s2", -1.0, 1.0, 0.05),
        Parameter("ay_mps2", "m/s2", -1.0, 1.0, 0.05, part_to_part=0.01),
        Parameter("yaw_rate_rad_s", "rad/s", -0.1, 0.1, 0.005, part_to_part=5e-4),
        Parameter("drift_mps3", "m/s3", -0.02, 0.02, 0.002),
    ),
    source="S: +-0.09 g over life (Hyundai); M: 0.02 to 0.05 m/s2 in a run",
    signature="constant, also at standstill",
    manoeuvre="coast_down",
    confounded_with=("road_grade", "rolling_resistance"),
    twins=("imu_gain",),
    sense=sense,
    undo=undo,
    nodes=("imu",),
)

"""IMU away from the centre of gravity."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """ax' = ax - x r^2 - y dr/dt, ay' = ay - y r^2 + x dr/dt."""
    yaw_rate = values[:, 2]
    last_s, last = memory.get("last", (time_s[0], yaw_rate[0]))
    step = np.diff(time_s, prepend=last_s)
    turning = np.diff(yaw_rate, prepend=last) / np.where(step > 0.0, step, 1.0)
    memory["last"] = (time_s[-1], yaw_rate[-1])
    x, y = number["x_m"][:, 0], number["y_m"][:, 0]
    out = values.copy()
    out[:, 0] += -x * yaw_rate**2 - y * turning
    out[:, 1] += -y * yaw_rate**2 + x * turning
    return out


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    added = sense(node, time_s, values, number, memory) - values
    return values - added


EFFECT = Effect(
    name="imu_position",
    row=57,
    title="IMU away from the centre of gravity",
    equation="ax' = ax - x r^2 - y dr/dt, ay' = ay - y r^2 + x dr/dt",
    injection_points=("sensor.imu",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(
        Parameter("x_m", "m", -1.5, 1.5, 0.3),
        Parameter("y_m", "m", -0.8, 0.8, 0.15),
    ),
    source="M: 0.3 m give 0.05 m/s2",
    signature="only with yaw",
    manoeuvre="brake_in_turn",
    confounded_with=("imu_gain", "pitch_dive"),
    sense=sense,
    undo=undo,
    nodes=("imu",),
)

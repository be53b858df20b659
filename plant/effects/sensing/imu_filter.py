"""A further low-pass in the IMU."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """tau a'' = a - a''."""
    at_s, state = memory.get("state", (time_s[0], values[0]))
    step = np.diff(time_s, prepend=at_s)
    tau = number["time_s"][:, 0]
    share = np.where(tau > 0.0, -np.expm1(-step / np.maximum(tau, 1e-9)), 1.0)
    out = np.empty_like(values)
    for k in range(len(values)):
        state = state + share[k] * (values[k] - state) if share[k] < 1.0 else values[k]
        out[k] = state
    memory["state"] = (time_s[-1], state)
    return out


EFFECT = Effect(
    name="imu_filter",
    row=58,
    title="A further low-pass in the IMU",
    equation="tau a'' = a - a''",
    joints=("sensor.imu",),
    scope=Scope.CAR,
    parameters=(Parameter("time_s", "s", 0.0, 0.1, 0.01),),
    source="S: cut-off of 20 to 40 Hz, lag of 6 to 10 ms (Hyundai)",
    signature="all transients of the IMU alone, loses amplitude above 10 Hz",
    manoeuvre="pressure_steps",
    confounded_with=("timestamp_offset",),
    sense=sense,
    nodes=("imu",),
)

"""A further low-pass in the IMU."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """tau a'' = a - a'', solved for straight lines between samples (Franklin et al. 1998, sec. 6.3).

    A lag much shorter than a sample delays by as much, as it has to: held values would hide it.
    """
    at_s, state, before = memory.get("state", (time_s[0], values[0], values[0]))
    step = np.diff(time_s, prepend=at_s)
    tau = number["time_s"][:, 0]
    slow = np.maximum(tau, 1e-9)
    forgotten = -np.expm1(-step / slow)
    mean = np.where(step > 0.0, forgotten * slow / np.where(step > 0.0, step, 1.0), 1.0)
    out = np.empty_like(values)
    for k in range(len(values)):
        if tau[k] > 0.0:
            state = state + forgotten[k] * (before - state) + (1.0 - mean[k]) * (values[k] - before)
        else:
            state = values[k]
        before = values[k]
        out[k] = state
    memory["state"] = (time_s[-1], state, before)
    return out


EFFECT = Effect(
    name="imu_filter",
    row=58,
    title="A further low-pass in the IMU",
    equation="tau a'' = a - a''",
    injection_points=("sensor.imu",),
    acts_when=Excitation.NONE,
    scope=Scope.CAR,
    parameters=(Parameter("time_s", "s", 0.0, 0.1, 0.01),),
    source="S: cut-off of 20 to 40 Hz, lag of 6 to 10 ms (Hyundai)",
    signature="all transients of the IMU alone, loses amplitude above 10 Hz",
    manoeuvre="pressure_steps",
    confounded_with=("timestamp_offset",),
    sense=sense,
    nodes=("imu",),
)

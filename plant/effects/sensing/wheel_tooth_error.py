"""Toothed wheel runs out of centre."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """w' = w (1 + a cos th + b sin th), th the integral of w."""
    last_s, angle = memory.get("angle", (time_s[0], np.zeros(values.shape[1])))
    step = np.diff(time_s, prepend=last_s)
    angles = angle + np.cumsum(step[:, None] * values, axis=0)
    memory["angle"] = (time_s[-1], angles[-1])
    factor: Vector = 1.0 + number["first_cosine"] * np.cos(angles) + number["first_sine"] * np.sin(angles)
    return values * factor


EFFECT = Effect(
    name="wheel_tooth_error",
    row=59,
    title="Toothed wheel runs out of centre",
    equation="w' = w (1 + a cos th + b sin th), th the integral of w",
    injection_points=("sensor.wheel",),
    acts_when=Excitation.NONE,
    scope=Scope.WHEEL,
    parameters=(
        Parameter("first_cosine", "", -0.02, 0.02, 0.001),
        Parameter("first_sine", "", -0.02, 0.02, 0.0005),
    ),
    source="D: 0.08 to 0.11 % at order 1 (comma2k19)",
    signature="order 1 at all torques, also coasting",
    manoeuvre="coast_down",
    confounded_with=("dtv_judder", "tyre_radius"),
    sense=sense,
    nodes=("wheel",),
)

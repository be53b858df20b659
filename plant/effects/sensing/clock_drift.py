"""One node's clock runs slow, or fast."""

import numpy as np

from plant.effects.effect import NODES, Effect, Parameter, Scope
from plant.effects.sensing.delay import advanced, delayed
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def late_s(node: str, time_s: Vector, number: Numbers) -> Vector:
    """e t, (samples,)."""
    return number["share"][:, NODES.index(node)] * np.maximum(time_s, 0.0)


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """s'(t) = s(t - e t); e below 0 needs whole arrays, no live node knows what comes."""
    return delayed(time_s, values, late_s(node, time_s, number), memory)


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return advanced(time_s, values, late_s(node, time_s, number))


EFFECT = Effect(
    name="clock_drift",
    row=66,
    title="One node's clock runs slow, or fast",
    equation="s'(t) = s(t - e t)",
    injection_points=("sensor.wheel", "sensor.imu", "sensor.pressure", "sensor.motor", "sensor.driver"),
    acts_when=(Excitation.NONE, Excitation.NONE, Excitation.BRAKES, Excitation.MOTORS, Excitation.NONE),
    scope=Scope.NODE,
    parameters=(Parameter("share", "", -0.002, 0.002, 0.0005, part_to_part=5e-5),),
    source="M: 20 to 100 ppm, 6 ms a minute; C: larger here, to be seen within a minute",
    signature="lag linear in the time of the log",
    manoeuvre="pressure_triangle",
    confounded_with=("timestamp_offset",),
    sense=sense,
    undo=undo,
    late_s=late_s,
    nodes=("wheel", "imu", "pressure", "motor", "driver"),
)

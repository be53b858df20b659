"""Wrong scale, sign or byte order in a database."""

from plant.effects.effect import NODES, Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """k' = k (1+e): e = -2 a sign, 2.6 km/h for m/s, 255 a byte."""
    return values * (1.0 + number["gain"][:, [NODES.index(node)]])


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return values / (1.0 + number["gain"][:, [NODES.index(node)]])


EFFECT = Effect(
    name="wrong_scale",
    row=69,
    title="Wrong scale, sign or byte order in a database",
    equation="k' = k (1+e): e = -2 a sign, 2.6 km/h for m/s, 255 a byte",
    injection_points=("sensor.wheel", "sensor.imu", "sensor.pressure", "sensor.motor", "sensor.driver"),
    acts_when=(Excitation.ALWAYS, Excitation.NONE, Excitation.BRAKES, Excitation.MOTORS, Excitation.NONE),
    scope=Scope.NODE,
    parameters=(Parameter("gain", "", -3.0, 300.0, 2.6, factor=1),),
    source="M: 1, -1, 3.6, 256",
    signature="exact constant ratio",
    manoeuvre="straight_stop",
    confounded_with=("tyre_radius", "pressure_gain", "imu_gain"),
    sense=sense,
    undo=undo,
    nodes=("wheel", "imu", "pressure", "motor", "driver"),
)

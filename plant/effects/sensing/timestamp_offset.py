"""One node's stamps are off: its samples are older than they say, or newer."""

from plant.effects.effect import NODE_LATENCY, NODES, Effect, Parameter, Scope
from plant.effects.sensing.delay import advanced, delayed
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector


def late_s(node: str, time_s: Vector, number: Numbers) -> Vector:
    """d, (samples,)."""
    return number["delay_s"][:, NODES.index(node)]


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """s'(t) = s(t - d); d below 0 needs whole arrays, no live node knows what comes."""
    return delayed(time_s, values, late_s(node, time_s, number), memory)


def undo(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """Inverse of `sense`."""
    return advanced(time_s, values, late_s(node, time_s, number))


EFFECT = Effect(
    name="timestamp_offset",
    row=65,
    title="One node's samples are older than their stamps, or newer",
    equation="s'(t) = s(t - d)",
    injection_points=("sensor.wheel", "sensor.imu", "sensor.pressure", "sensor.motor", "sensor.driver"),
    acts_when=(Excitation.NONE, Excitation.NONE, Excitation.BRAKES, Excitation.MOTORS, Excitation.NONE),
    scope=Scope.NODE,
    parameters=(Parameter("delay_s", "s", -0.05, 0.1, 0.02, aliases=(NODE_LATENCY,)),),
    source="M: 2 to 50 ms",
    signature="lag equal on all transients of one node",
    manoeuvre="pressure_steps",
    confounded_with=("ehb_dead_time", "imu_filter", "clock_drift", "tyre_relaxation"),
    sense=sense,
    undo=undo,
    late_s=late_s,
    nodes=("wheel", "imu", "pressure", "motor", "driver"),
)

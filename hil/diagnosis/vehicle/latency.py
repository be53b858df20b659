"""Latencies: how late the frames of each node are stamped beside those of the wheel speeds, and demands act.

Takes what a vehicle set states; gives value and half-width of each node. Wheel speeds are the clock of all others: a
logger with exact demands beside old sensors has late demands.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

LATENCY_NODES: Final = (
    "imu", "pressure", "motor", "pressure_demand", "motor_demand", "steering", "yaw_rate", "ground_speed",
)  # fmt: skip
"""Nodes in the order of `hil.diagnosis.simulation.parameter_set.ParameterSet.latency_s`. Demands and the steering wheel
may act later than they are logged; a yaw rate has a filter of its own and comes that much later than the accelerations.
"""
ALL_NODES: Final = "node_latency_s"
"""Key whose tolerance holds for every node but the last two; a set states its tolerance alone."""
MEASURED_S: Final = 4e-3
"""Half-width in a set that states every limit, as measurements of a car do, s."""
_UNSTATED_S: Final = {
    "imu": 20e-3, "pressure": 20e-3, "motor": 20e-3, "pressure_demand": 35e-3, "motor_demand": 35e-3,
    "steering": 35e-3, "yaw_rate": 6e-3, "ground_speed": 0.2,
}  # fmt: skip
"""Half-width where a set does not state it, s: a cycle of a bus (10 to 20 ms) of difference between two nodes, one or
two and the dead time of a motor between a demand and its action, the delay of a filter of 25 Hz, and a receiver that
computes its speed for 0.1 to 0.2 s. Times between the stamps of two frames of one sample, read from logs: 3 to 23 ms
(comma2k19)."""
_OWN: Final = ("yaw_rate", "ground_speed")
"""Nodes that `ALL_NODES` leaves alone."""
_DEAD_TIME_S: Final = 20e-3
"""What the half-width of a demand has beside that of the frames: the dead time of an actuator, s."""
_SHARE, _LEAST_S = 0.2, 1e-3
"""Half-width of a latency stated without tolerance: a share of it, and at least."""
_EARLY_S = 20e-3
"""How much earlier than its stamp a demand may act where a set does not state it, s: a logger gets the frame later."""


@dataclass(frozen=True)
class Latency:
    """Latency of a node's frames, s, its half-width (two standard deviations), and the least it may be."""

    value_s: float = 0.0
    half_width_s: float = MEASURED_S
    least_s: float = -float("inf")


def key_of(node: str) -> str:
    """Key of a vehicle set."""
    return f"{node}_latency_s"


LATENCY_KEYS: Final = tuple(map(key_of, LATENCY_NODES))


def latencies(values: Mapping[str, Any], tolerances: Mapping[str, float], measured: bool) -> tuple[Latency, ...]:
    """Latency of each node, from values and half-widths by key; ``measured``: the set states every limit."""
    every = tolerances.get(ALL_NODES)
    found = []
    for node in LATENCY_NODES:
        key = key_of(node)
        value = float(values.get(key, 0.0))
        default = MEASURED_S if measured and node != "yaw_rate" else _UNSTATED_S[node]
        is_demand = node.endswith("_demand")
        if every is not None and node not in _OWN:
            default = every + (_DEAD_TIME_S if is_demand and not measured else 0.0)
        if key in values:
            default = max(_SHARE * abs(value), _LEAST_S)
        least = -_EARLY_S if every is None and not measured else 0.0
        found.append(Latency(value, tolerances.get(key, default), min(least, value) if is_demand else -float("inf")))
    return tuple(found)

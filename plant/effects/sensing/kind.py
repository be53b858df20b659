"""What a sensing function takes.

``sense(node, time_s, values, number, memory)`` changes the signals of one node, shape (samples, signals): wheel speeds
(4, rad/s); ax, ay (m/s2) and yaw rate (rad/s); pressures (4, Pa); motor torques by their current (4, N m); pedal
travels (2); the speed over ground (1, m/s). ``number`` has each parameter, shape (samples, members). ``memory`` keeps
what the next samples need: one call for all samples, or a call for each, give the same.
"""

from collections.abc import Mapping, MutableMapping
from typing import Any

from plant.layout import Vector

Numbers = Mapping[str, Vector]
Memory = MutableMapping[str, Any]

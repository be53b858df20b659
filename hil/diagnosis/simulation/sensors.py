"""Sensor and clock effects on arrays: applied to simulated channels, and taken back from measured inputs and speeds.

Takes channels by group or inputs, (rows, columns), and theta; gives the same shapes. Nothing is delayed here: the
measurement model does that once, with the latency (`Chain.late_s`).
"""

from collections.abc import Mapping

import numpy as np

from hil.diagnosis.data.log import Floats
from plant.effects.effect import GROUND, NODES
from plant.effects.sensing.catalogue import SENSING
from plant.injection.sensing_chain import Chain
from plant.injection.theta import THETA
from plant.vectors import INPUT

Stack = Mapping[str, Floats]
_IMU = ("ax", "ay", "yaw")
NODE = {"wheel": "wheel", "pressure": "pressure", "motor": "motor", "gps": GROUND} | dict.fromkeys(_IMU, "imu")
"""The node of each group of channels."""
_INPUT = {"pressure": "pressure_pa", "motor": "motor_torque_nm"}
OUTPUT_SENSORS = np.concatenate(
    [
        np.arange(THETA.size)[THETA.slice(effect.name, parameter.name)]
        for effect in SENSING
        if not set(effect.nodes) & set(_INPUT)
        for parameter in effect.parameters
    ]
)
"""Indices in theta of sensing effects that leave the plant's inputs alone."""
SENSORS = np.concatenate(
    [
        np.arange(THETA.size)[THETA.slice(effect.name, name)]
        for effect in SENSING
        for name in (*(parameter.name for parameter in effect.parameters), "onset_s", "until_s")
    ]
)
"""Indices in theta of all parameters of sensors and clocks."""
_GROUND_SCALE = THETA.slice("speed_scale", "gain").start
_WHEEL_SCALE = THETA.slice("wrong_scale", "gain").start + NODES.index("wheel")


def before_sensors(inputs: Floats, theta: Floats, row_s: float) -> Floats:
    """Inputs before the sensors, (rows, INPUT.size); what loses information (a filter, a step) is left as it is."""
    chain = Chain(theta, in_time=True)
    if not any(chain.touches(node) for node in _INPUT):
        return inputs
    time_s: Floats = np.arange(len(inputs)) * row_s
    true = inputs.copy()
    for node, part in _INPUT.items():
        if chain.touches(node):
            where = INPUT.slice(part)
            true[:, where] = chain.undo(node, time_s, inputs[:, where])
    return true


def after_sensors(stack: Stack, chain: Chain, row_s: float) -> dict[str, Floats]:
    """Channels as the sensors give them; ``chain`` delays nothing."""
    sensed = dict(stack)
    time_s: Floats = np.arange(len(next(iter(stack.values())))) * row_s
    for group, node in NODE.items():
        if group in sensed and node != "imu" and chain.touches(node):
            sensed[group] = chain.sense(node, time_s, sensed[group])
    if chain.touches("imu") and any(name in sensed for name in _IMU):
        rest = np.zeros((len(time_s), 1))
        body = chain.sense("imu", time_s, np.hstack([sensed.get(name, rest) for name in _IMU]))
        sensed |= {name: body[:, k : k + 1] for k, name in enumerate(_IMU) if name in sensed}
    return sensed


def wheel_speed_before(measured_rad_s: float, theta: Floats) -> float:
    """Middle wheel speed before a wrong scale of the wheel node; other wheel effects change no start speed."""
    return measured_rad_s / (1.0 + float(theta[_WHEEL_SCALE]))


def ground_speed_before(measured_mps: float, theta: Floats) -> float:
    """Speed over ground before a wrong scale of its sensor."""
    return measured_mps / (1.0 + float(theta[_GROUND_SCALE]))

"""Coarse steps of the signals."""

import numpy as np

from plant.effects.effect import Effect, Parameter, Scope
from plant.effects.sensing.kind import Memory, Numbers
from plant.excitation import Excitation
from plant.layout import Vector

STEPS_OF = {
    "wheel": ("wheel_rad_s",) * 4,
    "imu": ("imu_mps2", "imu_mps2", "imu_rad_s"),
    "pressure": ("pressure_pa",) * 4,
    "motor": ("motor_nm",) * 4,
}


def sense(node: str, time_s: Vector, values: Vector, number: Numbers, memory: Memory) -> Vector:
    """s' = q round(s/q); a step finer than a float resolves leaves the value."""
    step = np.column_stack([number[name][:, 0] for name in STEPS_OF[node]])
    coarse = step > np.finfo(float).eps * np.abs(values)
    size = np.where(coarse, step, 1.0)
    return np.where(coarse, size * np.round(values / size), values)


EFFECT = Effect(
    name="quantisation",
    row=64,
    title="Coarse steps of the signals",
    equation="s' = q round(s/q)",
    injection_points=("sensor.wheel", "sensor.imu", "sensor.pressure", "sensor.motor"),
    acts_when=Excitation.ALWAYS,
    scope=Scope.CAR,
    parameters=(
        Parameter("wheel_rad_s", "rad/s", 0.0, 1.0, 0.1),
        Parameter("imu_mps2", "m/s2", 0.0, 0.5, 0.1),
        Parameter("imu_rad_s", "rad/s", 0.0, 0.05, 0.005),
        Parameter("pressure_pa", "Pa", 0.0, 200000.0, 50000.0),
        Parameter("motor_nm", "N m", 0.0, 10.0, 2.0),
    ),
    source="S: 0.05 m/s2 (Zoe), 0.1 bar (Kia), 0.5 N m (Zoe)",
    signature="staircase",
    manoeuvre="pressure_triangle",
    sense=sense,
    nodes=("wheel", "imu", "pressure", "motor"),
)

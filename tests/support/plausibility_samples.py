"""The checks alone, with limits that are sums of powers of two: a value can lie exactly on a limit, or just beyond."""

from dataclasses import replace
from math import inf, nan, nextafter

import numpy as np

from ecu.law.joint import layout as inputs
from ecu.law.plausibility.judge import initial_state, judge, judge_parameters
from ecu.parameters.plausibility import PlausibilityParameters

DT = 1 / 64
LIMITS = PlausibilityParameters(
    forget=1 / 64, heal_s=16 * DT,
    wheel_s=3 * DT, wheel_fall_rad_s2=64 / DT, wheel_rise_rad_s2=32 / DT, wheel_above=0.25, wheel_above_mps=4.125,
    speed_max_mps=128.25,
    pressure_s=5 * DT, pressure_pa=2.0**18, pressure_share=0.125, pressure_lag_s=7 * DT,
    motor_s=4 * DT, motor_nm=32.0, motor_share=0.25, motor_lag_s=3 * DT, motor_rate_nm_s=32 / DT,
    motor_start_s=4 * DT, motor_retry_s=8 * DT,
    acceleration_s=6 * DT, acceleration_mps2=0.5, acceleration_share=0.125, acceleration_lag_s=15 * DT,
    acceleration_jump_mps2=8.0, acceleration_rough_mps2=2.0,
    pedal_jump=0.15, pedal_rise_1_s=5.0,
)  # fmt: skip
RADIUS, ARM, MASS, MOTOR_MAX = 0.5, 0.25, 1024.0, 512.0


def beyond(limit, toward=inf):
    """The next number beyond a limit."""
    return nextafter(limit, toward)


class Judge:
    """Feeds one sample after the other: a car at 40 m/s that does not brake, and what a test makes different.

    ``z``, ``bits``, ``top``: of the last sample; ``state``: after it.
    """

    def __init__(self, parameters):
        vehicle = replace(parameters.vehicle, rolling_radius_m=RADIUS, force_arm_m=ARM, mass_kg=MASS)
        motor = replace(parameters.motor, torque_max_nm=MOTOR_MAX)
        self.p = judge_parameters(replace(parameters, vehicle=vehicle, motor=motor, plausibility=LIMITS))
        self.state = initial_state()
        self.z, self.bits, self.top = np.zeros(inputs.INPUTS), 0, 0.0

    def sample(self, speed=40.0, expected=0.0, grade=0.0, times=1, **differing):
        """Feed a sample; arrays by their names in the layout of the inputs."""
        for _ in range(times):
            z = np.zeros(inputs.INPUTS)
            z[inputs.WHEEL : inputs.WHEEL + 4] = 80.0
            z[inputs.AVAILABLE : inputs.AVAILABLE + 4] = 512.0
            for name, value in differing.items():
                place = getattr(inputs, name)
                if isinstance(value, tuple):
                    z[place : place + 4] = value
                else:
                    z[place] = value
            before = self.state.copy()
            after, self.bits, self.top = judge(self.state, z, self.p, speed, expected, grade, DT)
            assert np.array_equal(self.state, before, equal_nan=True)  # the old state stands
            self.state, self.z = after, z
        return self

    def four(self, place):
        return tuple(self.z[place : place + 4].tolist())

    @property
    def hold(self):
        return self.z[inputs.HOLD]


def one(i, value, rest=0.0):
    """Four values, one of them another."""
    return tuple(value if k == i else rest for k in range(4))


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


NAN4 = (nan,) * 4

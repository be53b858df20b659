"""The built-in sensing effects in the order in which a signal meets them."""

from plant.effects.effect import Effect
from plant.effects.sensing import (
    clock_drift,
    imu_bias,
    imu_filter,
    imu_gain,
    imu_position,
    pedal_sensor,
    pressure_gain,
    pressure_offset,
    quantisation,
    speed_scale,
    timestamp_offset,
    wheel_speed_lowv,
    wheel_tooth_error,
    wrong_scale,
)

SENSING: tuple[Effect, ...] = (
    imu_position.EFFECT,
    imu_gain.EFFECT,
    imu_bias.EFFECT,
    imu_filter.EFFECT,
    wheel_tooth_error.EFFECT,
    wheel_speed_lowv.EFFECT,
    pressure_gain.EFFECT,
    pressure_offset.EFFECT,
    pedal_sensor.EFFECT,
    wrong_scale.EFFECT,
    speed_scale.EFFECT,
    timestamp_offset.EFFECT,
    clock_drift.EFFECT,
    quantisation.EFFECT,
)

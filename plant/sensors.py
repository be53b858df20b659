"""Sensors: from the state to what a node measures. Filters are states of the model, quantisation is the DBC's."""

import zlib
from math import pi

import numpy as np
from numpy.typing import NDArray

from plant.parameters.sensing import SensorParameters
from plant.vectors import OUTPUT, STATE, X

Vector = NDArray[np.float64]


class Noise:
    """Normal noise, one independent stream for each signal, fixed by seed and name."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._streams: dict[str, np.random.Generator] = {}

    def normal(self, signal: str, count: int) -> Vector:
        """``count`` samples with standard deviation 1."""
        stream = self._streams.get(signal)
        if stream is None:
            stream = np.random.default_rng([self._seed, zlib.crc32(signal.encode())])
            self._streams[signal] = stream
        return stream.standard_normal(count)


class ToothedWheels:
    """Wheel speeds from the passing of teeth.

    The speed is the angle of the teeth that passed since the last sample over the time between the last tooth then and
    the last tooth now. Without a new tooth the speed is at most one pitch over the time since the last one, and zero
    after the time-out. A toothed wheel does not see the direction.
    """

    def __init__(self, parameters: SensorParameters, x: Vector, wheel_speed_rad_s: float) -> None:
        self._pitch = 2.0 * pi / parameters.teeth
        self._timeout_s = parameters.tooth_timeout_s
        self._time = x[STATE.slice("tooth_time_s")].copy()
        self._count = x[STATE.slice("tooth_count")].copy()
        self.speed = np.full(4, abs(wheel_speed_rad_s))

    def sample(self, x: Vector) -> Vector:
        """Speeds at the time of ``x``, rad/s."""
        now = x[X.time_s]
        times, counts = x[STATE.slice("tooth_time_s")], x[STATE.slice("tooth_count")]
        for i in range(4):
            passed = counts[i] - self._count[i]
            if passed > 0.0 and times[i] > self._time[i]:
                self.speed[i] = passed * self._pitch / (times[i] - self._time[i])
                self._time[i], self._count[i] = times[i], counts[i]
            else:
                waited = now - self._time[i]
                bound = self._pitch / waited if 0.0 < waited < self._timeout_s else 0.0
                if waited > 0.0:
                    self.speed[i] = min(self.speed[i], bound)
        return self.speed


class Sensors:
    """All measured signals of one car."""

    def __init__(self, parameters: SensorParameters, torque_constant_nm_a: float, seed: int) -> None:
        self._p = parameters
        self._torque_constant = torque_constant_nm_a
        self._noise = Noise(seed)
        self._pressure_offset = np.array(parameters.pressure_offset_pa)

    def start(self, x: Vector, wheel_speed_rad_s: float) -> None:
        """Begin with the wheels turning at a speed."""
        self._wheels = ToothedWheels(self._p, x, wheel_speed_rad_s)

    def wheel_speed_rad_s(self, x: Vector) -> list[float]:
        """Toothed-wheel speeds with tooth errors in proportion."""
        measured = self._wheels.sample(x) * (1.0 + self._p.wheel_speed_noise * self._noise.normal("wheel_speed", 4))
        return [float(v) for v in measured]

    def body_motion(self, x: Vector) -> tuple[float, float, float]:
        """Longitudinal and lateral specific force, m/s2, and yaw rate, rad/s."""
        p, noise = self._p, self._noise.normal("imu", 3)
        return (
            x[X.imu_longitudinal_mps2] + p.acceleration_offset_mps2[0] + p.acceleration_noise_mps2 * noise[0],
            x[X.imu_lateral_mps2] + p.acceleration_offset_mps2[1] + p.acceleration_noise_mps2 * noise[1],
            x[X.imu_yaw_rate_rad_s] + p.yaw_rate_offset_rad_s + p.yaw_rate_noise_rad_s * noise[2],
        )

    def pressure_pa(self, y: Vector) -> list[float]:
        """Pressures at the calipers."""
        noise = self._p.pressure_noise_pa * self._noise.normal("pressure", 4)
        return [float(v) for v in y[OUTPUT.slice("pressure_pa")] + self._pressure_offset + noise]

    def current_a(self, y: Vector) -> list[float]:
        """Torque-producing motor currents, signed like the torque."""
        true = y[OUTPUT.slice("motor_torque_nm")] / self._torque_constant
        return [float(v) for v in true + self._p.current_noise_a * self._noise.normal("current", 4)]

    def pedal(self, travel: float) -> tuple[float, float]:
        """Both channels of the pedal travel."""
        noise, p = self._noise.normal("pedal", 2), self._p
        one, two = (travel + p.pedal_offset[k] + p.pedal_noise * float(noise[k]) for k in (0, 1))
        return one, two

    def steering_wheel_rad(self, angle_rad: float) -> float:
        """Steering-wheel angle."""
        return angle_rad + self._p.steering_noise_rad * float(self._noise.normal("steering", 1)[0])

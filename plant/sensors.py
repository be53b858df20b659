"""Sensors: from the state to what a node measures. Filters are states of the model, quantisation is the DBC's."""

import zlib
from math import pi

import numpy as np

from plant.injection.sensing_chain import Chain
from plant.layout import Vector
from plant.parameters.sensing import SensorParameters
from plant.vectors import X, Y

BLOCK = 256  # samples drawn at once


class Noise:
    """Normal noise, one independent stream for each signal, fixed by seed and name."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._streams: dict[str, np.random.Generator] = {}
        self._drawn: dict[str, list[float]] = {}

    def normal(self, signal: str, count: int) -> list[float]:
        """``count`` samples with standard deviation 1."""
        drawn = self._drawn.get(signal)
        if not drawn:
            if signal not in self._streams:
                self._streams[signal] = np.random.default_rng([self._seed, zlib.crc32(signal.encode())])
            drawn = self._streams[signal].standard_normal(count * BLOCK).tolist()
            self._drawn[signal] = drawn
        taken = drawn[-count:]
        del drawn[-count:]
        return taken


class ToothedWheels:
    """Wheel speeds from the passing of teeth.

    The speed is the angle of the teeth that passed since the last sample over the time between the last tooth then and
    the last tooth now. Without a new tooth the speed is at most one pitch over the time since the last one, and zero
    after the time-out. A toothed wheel does not see the direction.
    """

    def __init__(self, parameters: SensorParameters, x: Vector, wheel_speed_rad_s: float) -> None:
        self._pitch = 2.0 * pi / parameters.teeth
        self._timeout_s = parameters.tooth_timeout_s
        self._time: list[float] = x[X.tooth_time_s : X.tooth_time_s + 4].tolist()
        self._count: list[float] = x[X.tooth_count : X.tooth_count + 4].tolist()
        self._speed = [abs(wheel_speed_rad_s)] * 4

    def sample(self, x: Vector) -> list[float]:
        """Speeds at the time of ``x``, rad/s."""
        now = float(x[X.time_s])
        times: list[float] = x[X.tooth_time_s : X.tooth_time_s + 4].tolist()
        counts: list[float] = x[X.tooth_count : X.tooth_count + 4].tolist()
        for i in range(4):
            passed = counts[i] - self._count[i]
            waited = now - self._time[i]
            if passed > 0.0 and times[i] > self._time[i]:
                self._speed[i] = passed * self._pitch / (times[i] - self._time[i])
                self._time[i], self._count[i] = times[i], counts[i]
            elif waited >= self._timeout_s:
                self._speed[i] = 0.0
            elif waited > 0.0:
                self._speed[i] = min(self._speed[i], self._pitch / waited)
        return self._speed


class Sensors:
    """All measured signals of one car, whose wheels turn at a speed when it starts.

    Attributes
    ----------
    chain : sensing effects, None where there are none.
    """

    def __init__(
        self, parameters: SensorParameters, torque_constant_nm_a: float, seed: int, x: Vector, wheel_speed_rad_s: float
    ) -> None:
        self._p = parameters
        self._torque_constant = torque_constant_nm_a
        self._noise = Noise(seed)
        self._wheels = ToothedWheels(parameters, x, wheel_speed_rad_s)
        self.chain: Chain | None = None
        self._time_s = np.zeros(1)

    def tick(self, time_s: float) -> None:
        """Go to the model's time of the samples that follow."""
        self._time_s = np.array([time_s])

    def _reported(self, node: str, values: list[float]) -> list[float]:
        if self.chain is None or not self.chain.touches(node):
            return values
        reported: list[float] = self.chain.sense(node, self._time_s, np.array([values]))[0].tolist()
        return reported

    def wheel_speed_rad_s(self, x: Vector, y: Vector) -> list[float]:
        """Toothed-wheel speeds; the teeth's errors grow with the speed."""
        noise, share = self._noise.normal("wheel_speed", 4), self._p.wheel_speed_noise
        true: list[float] = x[X.wheel_speed_rad_s : X.wheel_speed_rad_s + 4].tolist()
        off: list[float] = y[Y.sensed_wheel_speed_rad_s : Y.sensed_wheel_speed_rad_s + 4].tolist()
        teeth = self._wheels.sample(x)
        speeds = [(teeth[i] + (off[i] - true[i])) * (1.0 + share * noise[i]) for i in range(4)]
        return self._reported("wheel", speeds)

    def body_motion(self, x: Vector) -> tuple[float, float, float]:
        """Longitudinal and lateral specific force, m/s2, and yaw rate, rad/s."""
        p, noise = self._p, self._noise.normal("imu", 3)
        longitudinal, lateral, yaw_rate = x[X.imu_longitudinal_mps2 : X.imu_longitudinal_mps2 + 3].tolist()
        values = [
            longitudinal + p.acceleration_offset_mps2[0] + p.acceleration_noise_mps2 * noise[0],
            lateral + p.acceleration_offset_mps2[1] + p.acceleration_noise_mps2 * noise[1],
            yaw_rate + p.yaw_rate_offset_rad_s + p.yaw_rate_noise_rad_s * noise[2],
        ]
        ax, ay, turning = self._reported("imu", values)
        return ax, ay, turning

    def pressure_pa(self, y: Vector) -> list[float]:
        """Pressures at the calipers."""
        noise, p = self._noise.normal("pressure", 4), self._p
        true: list[float] = y[Y.sensed_pressure_pa : Y.sensed_pressure_pa + 4].tolist()
        values = [true[i] + p.pressure_offset_pa[i] + p.pressure_noise_pa * noise[i] for i in range(4)]
        return self._reported("pressure", values)

    def current_a(self, y: Vector) -> list[float]:
        """Torque-producing motor currents, signed like the torque."""
        noise, sigma = self._noise.normal("current", 4), self._p.current_noise_a
        true: list[float] = y[Y.sensed_motor_nm : Y.sensed_motor_nm + 4].tolist()
        values = [torque + self._torque_constant * sigma * n for torque, n in zip(true, noise, strict=True)]
        return [torque / self._torque_constant for torque in self._reported("motor", values)]

    def pedal(self, travel: float) -> tuple[float, float]:
        """Both channels of the pedal travel."""
        noise, p = self._noise.normal("pedal", 2), self._p
        values = [travel + p.pedal_offset[i] + p.pedal_noise * noise[i] for i in range(2)]
        first, second = self._reported("driver", values)
        return first, second

    def steering_wheel_rad(self, angle_rad: float) -> float:
        """Steering-wheel angle."""
        return angle_rad + self._p.steering_noise_rad * self._noise.normal("steering", 1)[0]

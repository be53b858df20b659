"""Sensors: from the state to what a node measures. Filters are states of the model, quantisation is the DBC's."""

import zlib
from math import pi

import numpy as np

from plant.compiled import exact_entry
from plant.injection.sensing_chain import Chain
from plant.layout import Layout, Vector
from plant.vectors import P, X, Y

BLOCK = 256  # samples drawn at once
SENSED = Layout(
    "Sensed",
    {"pedal": 2, "steering_wheel_rad": 1, "wheel_speed_rad_s": 4, "body_motion": 3, "pressure_pa": 4, "motor_nm": 4},
)
"""What is measured at a tick: both pedal channels; specific forces, m/s2, and yaw rate, rad/s; the torque of each motor
that its current stands for."""
N = SENSED.at
_STREAMS = {
    "pedal": "pedal", "steering_wheel_rad": "steering", "wheel_speed_rad_s": "wheel_speed", "body_motion": "imu",
    "pressure_pa": "pressure", "motor_nm": "current",
}  # fmt: skip
_CHAINED = {
    "driver": SENSED.slice("pedal"), "wheel": SENSED.slice("wheel_speed_rad_s"), "imu": SENSED.slice("body_motion"),
    "pressure": SENSED.slice("pressure_pa"), "motor": SENSED.slice("motor_nm"),
}  # fmt: skip
"""Which nodes' signals sensing effects change (`plant.injection.sensing_chain`)."""
_TIME, _COUNT, _SPEED = 0, 1, 2  # rows of what toothed wheels remember


class Noise:
    """Normal noise with standard deviation 1, one independent stream for each part, fixed by seed and name."""

    def __init__(self, seed: int) -> None:
        self._streams = [
            (np.random.default_rng([seed, zlib.crc32(_STREAMS[part].encode())]), size)
            for part, size in SENSED.sizes.items()
        ]
        self._rows = np.empty((0, SENSED.size))
        self._next = -1

    def row(self) -> Vector:
        """Noise of the next tick (``SENSED``)."""
        if self._next < 0:  # blocks are used from their ends
            blocks = [stream.standard_normal((BLOCK, size)) for stream, size in self._streams]
            self._rows, self._next = np.concatenate(blocks, axis=1), BLOCK - 1
        self._next -= 1
        row: Vector = self._rows[self._next + 1]
        return row


@exact_entry
def count_speed(x: Vector, p: Vector, wheels: Vector) -> None:
    """Wheel speeds from the passing of teeth, into the last row of ``wheels``.

    The speed is the angle of the teeth that passed since the last sample over the time between the last tooth then and
    the last tooth now. Without a new tooth the speed is at most one pitch over the time since the last one, and zero
    after the time-out. A toothed wheel does not see the direction.

    Parameters
    ----------
    x, p : vectors ``STATE`` and ``PARAMETER``.
    wheels : time and count of the last tooth, and the speed, rad/s; shape (3, 4).
    """
    pitch, now = 2.0 * pi / p[P.sensor_teeth], x[X.time_s]
    for i in range(4):
        tooth_s, count = x[X.tooth_time_s + i], x[X.tooth_count + i]
        passed, waited = count - wheels[_COUNT, i], now - wheels[_TIME, i]
        if passed > 0.0 and tooth_s > wheels[_TIME, i]:
            wheels[_SPEED, i] = passed * pitch / (tooth_s - wheels[_TIME, i])
            wheels[_TIME, i], wheels[_COUNT, i] = tooth_s, count
        elif waited >= p[P.sensor_tooth_timeout_s]:
            wheels[_SPEED, i] = 0.0
        elif waited > 0.0:
            wheels[_SPEED, i] = min(wheels[_SPEED, i], pitch / waited)


@exact_entry
def measure(
    x: Vector,
    y: Vector,
    p: Vector,
    travel: float,
    steering_wheel_rad: float,
    noise: Vector,
    wheels: Vector,
    out: Vector,
) -> None:
    """What all sensors say, into ``out`` (``SENSED``), before sensing effects.

    Parameters
    ----------
    x, y, p : vectors ``STATE``, ``OUTPUT`` and ``PARAMETER``.
    travel, steering_wheel_rad : what the driver does.
    noise : of this tick (``SENSED``).  wheels : of `count_speed`.
    """
    count_speed(x, p, wheels)
    for i in range(2):
        out[N.pedal + i] = travel + p[P.sensor_pedal_offset + i] + p[P.sensor_pedal_noise] * noise[N.pedal + i]
    steered = p[P.sensor_steering_noise_rad] * noise[N.steering_wheel_rad]
    out[N.steering_wheel_rad] = steering_wheel_rad + steered
    for i in range(4):
        off = y[Y.sensed_wheel_speed_rad_s + i] - x[X.wheel_speed_rad_s + i]  # the teeth's errors grow with the speed
        share = 1.0 + p[P.sensor_wheel_speed_noise] * noise[N.wheel_speed_rad_s + i]
        out[N.wheel_speed_rad_s + i] = (wheels[_SPEED, i] + off) * share
    for i in range(2):
        true, offset = x[X.imu_longitudinal_mps2 + i], p[P.sensor_acceleration_offset_mps2 + i]
        out[N.body_motion + i] = true + offset + p[P.sensor_acceleration_noise_mps2] * noise[N.body_motion + i]
    turned = p[P.sensor_yaw_rate_noise_rad_s] * noise[N.body_motion + 2]
    out[N.body_motion + 2] = x[X.imu_yaw_rate_rad_s] + p[P.sensor_yaw_rate_offset_rad_s] + turned
    sigma_nm = p[P.motor_torque_constant_nm_a] * p[P.sensor_current_noise_a]
    for i in range(4):
        true, offset = y[Y.sensed_pressure_pa + i], p[P.sensor_pressure_offset_pa + i]
        out[N.pressure_pa + i] = true + offset + p[P.sensor_pressure_noise_pa] * noise[N.pressure_pa + i]
        out[N.motor_nm + i] = y[Y.sensed_motor_nm + i] + sigma_nm * noise[N.motor_nm + i]


class Sensors:
    """All measured signals of one car, whose wheels turn at a speed when it starts.

    Parameters
    ----------
    p, x : vectors ``PARAMETER`` and ``STATE`` at the start.
    seed : of all noise.
    wheel_speed_rad_s : of all wheels at the start.
    """

    def __init__(self, p: Vector, seed: int, x: Vector, wheel_speed_rad_s: float) -> None:
        self._p = p
        self._noise = Noise(seed)
        teeth = x[X.tooth_time_s : X.tooth_time_s + 4], x[X.tooth_count : X.tooth_count + 4]
        self._wheels = np.array([*teeth, [abs(wheel_speed_rad_s)] * 4])
        self._out = SENSED.zeros()
        self._chain: Chain | None = None
        self._touched: list[tuple[str, slice]] = []

    def distort(self, chain: Chain) -> None:
        """Put sensing effects behind the sensors from now on."""
        self._chain = chain
        self._touched = [(node, where) for node, where in _CHAINED.items() if chain.touches(node)]

    def sample(self, x: Vector, y: Vector, travel: float, steering_wheel_rad: float) -> Vector:
        """What the sensors say of a state, its outputs, pedal and steering wheel: ``SENSED``, good until the next."""
        out = self._out
        measure(x, y, self._p, travel, steering_wheel_rad, self._noise.row(), self._wheels, out)
        for node, where in self._touched:
            assert self._chain is not None
            out[where] = self._chain.sense(node, x[X.time_s : X.time_s + 1].copy(), out[None, where].copy())[0]
        return out

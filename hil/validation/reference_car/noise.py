"""Noise of the reference car: gusts, sensors, bus. The exact size of a level is drawn and stays secret."""

from dataclasses import dataclass
from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.validation.reference_car.manoeuvres import TICK_S

Vector = NDArray[np.float64]
LEVELS = {"low": 0.5, "medium": 1.0, "high": 2.0}
"""Noise levels: what multiplies all noises, before 0.8 to 1.25 drawn by seed."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations, SI; wheel speed: constant and share of the speed.

    Attributes
    ----------
    gust_mps2, slope_mps2, drift_mps2 : coloured (AR(1)): force over mass on the body, g times the slope of the road
        (the accelerometer does not feel it), error of the accelerometer.
    wheel_drift : coloured share of each wheel's speed.  ay_drift_mps2, yaw_drift_rad_s, pressure_drift_pa,
        torque_drift_nm : coloured errors of these channels.  ..._tau_s : time constants.
    order_share : once-per-revolution error of the wheel speed with an amplitude and phase that wander.
    wheel_rad_s ... torque_nm : white noise of the sensors.
    latency_s : of the frames of wheel, imu, pressure and motor node against the wheel node's.
    queue_s : mean of the waiting time of a frame.
    """

    level: str
    gust_mps2: float
    slope_mps2: float
    drift_mps2: float
    wheel_drift: float
    ay_drift_mps2: float
    yaw_drift_rad_s: float
    pressure_drift_pa: float
    torque_drift_nm: float
    gust_tau_s: float
    slope_tau_s: float
    drift_tau_s: float
    sensor_tau_s: float
    order_share: float
    wheel_rad_s: float
    wheel_share: float
    ax_mps2: float
    ay_mps2: float
    yaw_rad_s: float
    pressure_pa: float
    torque_nm: float
    speed_mps: float
    latency_s: tuple[float, float, float, float]
    queue_s: float


QUANTUM = {
    "wheel": 0.009,
    "ax": 0.01,
    "ay": 0.01,
    "yaw": 0.0009,
    "pressure": 1.0e4,
    "motor": 0.5,
    "speed": 0.01,
    "soc": 0.001,
}
"""Last bit of each channel on the bus, SI."""

LATEST_S = 0.0008
"""Most that the frames of a node are sent later or earlier than the wheel node's."""
USUALLY_LATE_S = LATEST_S / 3.0**0.5
"""Standard deviation of that; all latencies are as likely."""


def whole(values: Vector, channel: str) -> Vector:
    """Values as a frame says them."""
    return np.asarray(np.round(values / QUANTUM[channel]) * QUANTUM[channel])


def draw_noise(level: str, rng: np.random.Generator) -> Noise:
    """Draw the noise of one case."""
    size = LEVELS[level]

    def around(value: float) -> float:
        return value * size * float(rng.uniform(0.8, 1.25))

    def late() -> float:
        return float(rng.uniform(-LATEST_S, LATEST_S))

    return Noise(
        level=level, gust_mps2=around(0.02), slope_mps2=around(0.02), drift_mps2=around(0.008),
        wheel_drift=around(0.0004),
        ay_drift_mps2=around(0.03), yaw_drift_rad_s=around(0.002), pressure_drift_pa=around(4.0e3),
        torque_drift_nm=around(0.6), gust_tau_s=float(rng.uniform(0.5, 2.0)), slope_tau_s=float(rng.uniform(1.0, 4.0)),
        drift_tau_s=float(rng.uniform(2.0, 6.0)), sensor_tau_s=float(rng.uniform(0.5, 2.0)), order_share=around(0.0002),
        wheel_rad_s=around(0.01), wheel_share=around(0.0008), ax_mps2=around(0.02), ay_mps2=around(0.02),
        yaw_rad_s=around(0.001), pressure_pa=around(1.0e4), torque_nm=around(0.8), speed_mps=around(0.03),
        latency_s=(0.0, late(), late(), late()), queue_s=0.0003,
    )  # fmt: skip


def coloured(count: int, deviation: float, tau_s: float, step_s: float, rng: np.random.Generator) -> Vector:
    """AR(1) noise with a standard deviation and a time constant, from its own rest distribution."""
    keep = exp(-step_s / tau_s)
    drive = rng.standard_normal(count) * deviation * sqrt(1.0 - keep * keep)
    drive[0] = rng.standard_normal() * deviation
    return np.asarray(lfilter([1.0], [1.0, -keep], drive), dtype=np.float64)


def gusts(ticks: int, noise: Noise, rng: np.random.Generator) -> Vector:
    """Coloured force over mass on the body, and g times the slope, every 10 ms, (ticks, 2), m/s2."""
    force = coloured(ticks, noise.gust_mps2, noise.gust_tau_s, TICK_S, rng)
    slope = coloured(ticks, noise.slope_mps2, noise.slope_tau_s, TICK_S, rng)
    return np.stack((force, slope), axis=1)

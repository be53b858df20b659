"""From what happened to a log: teeth, filters, node clocks, bus, quantisation; with what may be hidden in them."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.validation.reference_car.car import NOMINAL
from hil.validation.reference_car.drive import STEP_S, Driven
from hil.validation.reference_car.manoeuvres import TICK_S
from hil.validation.reference_car.noise import Noise, coloured, whole
from hil.validation.reference_car.strengths import S

Vector = NDArray[np.float64]
WHEELS = ("fl", "fr", "rl", "rr")
NODES = ("wheel", "imu", "pressure", "motor")
TEETH, TIMEOUT_S = 48, 0.5
ORDER_TAU_S, STEERING_RAD = 0.3, 0.0005
SATELLITE_TICKS = 10


@dataclass(frozen=True)
class SensorFault:
    """One hidden sensor effect: strength per wheel or per node of `NODES` (one value where the car has one)."""

    strength: Vector
    onset_s: float = 0.0


Faults = Mapping[str, SensorFault]


class _Sampling:
    """One log in the making: when each node samples, what is hidden in it, and its noise.

    Noise is drawn for the whole drive, so that both runs of a pair see the same whichever ends first.
    """

    def __init__(self, driven: Driven, noise: Noise, faults: Faults, seed: tuple[int, ...], clean: bool) -> None:
        self.driven, self.noise, self.clean = driven, noise, clean
        self._faults, self._rng, self._draws = faults, np.random.default_rng(seed), driven.manoeuvre.ticks
        self.rows = len(driven.states) // round(TICK_S / STEP_S) - 1
        self.cycle_s = np.arange(self.rows, dtype=np.float64) * TICK_S
        sent = [self.cycle_s + late + noise.queue_s * self.waiting() for late in noise.latency_s]
        self.stamp_s = np.maximum.accumulate(sent[0] + np.arange(self.rows) * 1e-9)
        self.taken_s = {
            node: _sampled(k, sent[k], faults, self.waiting()) for k, node in enumerate(NODES)
        }  # when the value on each row was taken

    def state(self, first: int, t: Vector, columns: int = 1) -> Vector:
        """States at times, (rows, columns)."""
        true_t = self.driven.t_s
        return np.stack([np.interp(t, true_t, self.driven.states[:, first + i]) for i in range(columns)], axis=1)

    def waiting(self) -> Vector:
        """Waiting times of frames, mean 1."""
        return self._rng.exponential(1.0, self._draws)[: self.rows]

    def white(self, columns: int) -> Vector:
        """White noise, standard deviation 1; nothing in a clean log."""
        drawn = self._rng.standard_normal((self._draws, columns))[: self.rows]
        return drawn * (0.0 if self.clean else 1.0)

    def drift(self, columns: int, deviation: float, tau_s: float) -> Vector:
        """Coloured noise; nothing in a clean log."""
        drawn = [coloured(self._draws, deviation, tau_s, TICK_S, self._rng)[: self.rows] for _ in range(columns)]
        return np.stack(drawn, axis=1) * (0.0 if self.clean else 1.0)

    def fault(self, name: str, columns: int = 4) -> Vector:
        """Strength of a hidden sensor effect over the rows, zero before its onset, (rows, columns)."""
        found = self._faults.get(name)
        if found is None:
            return np.zeros((self.rows, columns))
        return np.where(self.cycle_s[:, None] >= found.onset_s, found.strength[None, :columns], 0.0)

    def scale(self, node: str) -> Vector:
        """Factor of a wrong scale, (rows, 1)."""
        k = NODES.index(node)
        return 1.0 + self.fault("wrong_scale")[:, k : k + 1]

    def whole(self, values: Vector, channel: str) -> Vector:
        """Quantised; not in a clean log."""
        return values if self.clean else whole(values, channel)

    def lost(self, node: str) -> NDArray[np.bool_]:
        """Rows whose frame is lost."""
        return self._rng.random(self._draws)[: self.rows] < self.fault("frame_drop")[:, NODES.index(node)]


def observe(
    driven: Driven, noise: Noise, faults: Faults, seed: tuple[int, ...], clean: bool = False
) -> dict[str, Vector]:
    """Canonical columns of one log.

    Parameters
    ----------
    clean : leaves out noise, teeth and quantisation, but not the clocks: for pairs of runs.
    """
    log = _Sampling(driven, noise, faults, seed, clean)
    table = {"t_s": log.stamp_s, **_wheels(log), **_imu(log), **_pressures(log), **_motors(log)}
    table["steer_rad"] = driven.manoeuvre.steering_wheel_rad[: log.rows] + STEERING_RAD * log.white(1)[:, 0]
    table["soc"] = log.whole(log.state(S.state_of_charge, log.cycle_s)[:, 0], "soc")
    ground = log.state(S.speed_mps, log.cycle_s)[:, 0] + noise.speed_mps * log.white(1)[:, 0]
    ground = log.whole(ground * (1.0 + log.fault("speed_scale", 1)[:, 0]), "speed")
    table["speed_mps"] = np.where(np.arange(log.rows) % SATELLITE_TICKS == 0, ground, np.nan)
    for node in NODES:
        _hold(table, node, log.lost(node))
    return table


def _wheels(log: _Sampling) -> dict[str, Vector]:
    """Toothed wheels: white noise, an error once per turn that wanders, a share that drifts."""
    noise, taken = log.noise, log.taken_s["wheel"]
    omega, angle = log.state(S.omega_rad_s, taken, 4), log.state(S.angle_rad, taken, 4)
    speed = omega if log.clean else _from_teeth(log.driven, taken)
    cosine, sine = (log.drift(4, noise.order_share, ORDER_TAU_S) for _ in range(2))
    share = cosine * np.cos(angle) + sine * np.sin(angle) + log.drift(4, noise.wheel_drift, noise.sensor_tau_s)
    error = log.white(4) * (noise.wheel_rad_s + noise.wheel_share * np.abs(omega)) + share * omega
    speed = speed * (1.0 + log.fault("wheel_tooth_error") * np.cos(angle)) + (np.abs(speed) > 0.05) * error
    speed = np.where(np.abs(speed) * NOMINAL.rolling_radius_m < log.fault("wheel_speed_lowv", 1), 0.0, speed)
    return _named("wheel_speed", "rad_s", log.whole(speed * log.scale("wheel"), "wheel"))


def _imu(log: _Sampling) -> dict[str, Vector]:
    noise = log.noise
    felt = log.state(S.imu_ax_mps2, log.taken_s["imu"], 3)
    lag = log.fault("imu_filter", 1)
    if lag.any():
        felt = np.where(lag > 0.0, _low_pass(felt, float(lag.max())), felt)
    felt = felt + log.white(3) * (noise.ax_mps2, noise.ay_mps2, noise.yaw_rad_s)
    felt[:, :1] += log.drift(1, noise.drift_mps2, noise.drift_tau_s)
    felt[:, 1:2] += log.drift(1, noise.ay_drift_mps2, noise.sensor_tau_s)
    felt[:, 2:] += log.drift(1, noise.yaw_drift_rad_s, noise.sensor_tau_s)
    felt[:, :1] = felt[:, :1] * (1.0 + log.fault("imu_gain", 1)) + log.fault("imu_bias", 1)
    felt = felt * log.scale("imu")
    step = log.fault("quantisation", 1)
    coarse = np.round(felt / np.where(step > 0.0, step, 1.0)) * step
    felt[:, :2] = np.where(step > 0.0, coarse, felt)[:, :2]
    names = (("ax_mps2", "ax"), ("ay_mps2", "ay"), ("yaw_rate_rad_s", "yaw"))
    return {name: log.whole(felt[:, k], channel) for k, (name, channel) in enumerate(names)}


def _pressures(log: _Sampling) -> dict[str, Vector]:
    pressure = log.state(S.pressure_pa, log.taken_s["pressure"], 4) + log.noise.pressure_pa * log.white(4)
    pressure += log.drift(4, log.noise.pressure_drift_pa, log.noise.sensor_tau_s)
    pressure = pressure * (1.0 + log.fault("pressure_gain")) + log.fault("pressure_offset")
    demand = log.driven.pressure_demand_pa[: log.rows]
    measured = log.whole(pressure * log.scale("pressure"), "pressure")
    return _named("pressure", "pa", measured) | _named("pressure_demand", "pa", demand)


def _motors(log: _Sampling) -> dict[str, Vector]:
    torque = log.state(S.motor_nm, log.taken_s["motor"], 4) + log.noise.torque_nm * log.white(4)
    torque += log.drift(4, log.noise.torque_drift_nm, log.noise.sensor_tau_s)
    demand = log.driven.motor_demand_nm[: log.rows]
    measured = log.whole(torque * log.scale("motor"), "motor")
    return _named("motor_torque", "nm", measured) | _named("motor_torque_demand", "nm", demand)


def _sampled(k: int, t: Vector, faults: Faults, waiting: Vector) -> Vector:
    """When the value on a row was taken: s(t - d), a clock that drifts, a bus that makes frames wait."""
    result = t
    for name in ("timestamp_offset", "clock_drift", "jitter"):
        found = faults.get(name)
        if found is None or found.strength[k] == 0.0:
            continue
        size = np.where(t >= found.onset_s, found.strength[k], 0.0)
        if name == "clock_drift":
            size = size * (t - t[0])
        elif name == "jitter":
            size = size * waiting
        result = result - size
    return result


def _from_teeth(driven: Driven, t: Vector) -> Vector:
    """Speed from the teeth that pass within 10 ms around each time; none for half a second is standstill.

    The angle between the last tooth before the window's end and the last one before its start, over the time between;
    which way the wheel turns the sensor tells as well.
    """
    pitch, true_t, way = 2.0 * pi / TEETH, driven.t_s, np.copysign(1.0, driven.manoeuvre.speed_mps)
    speeds = np.zeros((len(t), 4))
    for i in range(4):
        angle = np.maximum.accumulate(way * driven.states[:, S.angle_rad + i])
        angle = angle + 1e-12 * np.arange(len(angle))
        passed = np.interp(np.arange(1, int(angle[-1] / pitch) + 1) * pitch, angle, true_t)
        if len(passed) < 2:
            continue
        last, first = (np.searchsorted(passed, t + side * 0.5 * TICK_S, side="right") - 1 for side in (1.0, -1.0))
        count = last - first
        ok = (count > 0) & (first >= 0)
        span = passed[np.maximum(last, 0)] - passed[np.maximum(first, 0)]
        speed = np.where(ok, count * pitch / np.where(ok, span, 1.0), np.nan)
        if driven.manoeuvre.speed_mps != 0.0:  # a car that rolled before the log began
            speed[: int(np.argmax(ok))] = speed[int(np.argmax(ok))]
        held = np.maximum.accumulate(np.where(np.isfinite(speed), np.arange(len(t)), 0))
        waited = np.maximum(t + 0.5 * TICK_S - passed[np.maximum(last, 0)], 1e-3)
        least = np.where(waited > TIMEOUT_S, 0.0, np.minimum(np.nan_to_num(speed[held]), pitch / waited))
        speeds[:, i] = way * np.where(np.isfinite(speed), speed, least)
    return speeds


def _low_pass(values: Vector, tau_s: float) -> Vector:
    keep = float(np.exp(-TICK_S / tau_s))
    start = values[:1] * keep
    filtered, _ = lfilter([1.0 - keep], [1.0, -keep], values, axis=0, zi=start)
    return np.asarray(filtered, dtype=np.float64)


def _named(stem: str, unit: str, values: Vector) -> dict[str, Vector]:
    return {f"{stem}_{wheel}_{unit}": values[:, i] for i, wheel in enumerate(WHEELS)}


def _hold(table: dict[str, Vector], node: str, lost: NDArray[np.bool_]) -> None:
    """Repeat the last frame that came."""
    stems = {
        "wheel": ("wheel_speed_",),
        "imu": ("ax_", "ay_", "yaw_"),
        "pressure": ("pressure_",),
        "motor": ("motor_torque_",),
    }
    if not lost.any():
        return
    lost = lost & (np.arange(len(lost)) > 0)
    source = np.maximum.accumulate(np.where(lost, 0, np.arange(len(lost))))
    for name in table:
        if name.startswith(stems[node]) and "demand" not in name:
            table[name] = table[name][source]

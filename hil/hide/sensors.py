"""From what happened to a log: teeth, filters, node clocks, bus, quantisation; with what may be hidden in them."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from hil.hide.drive import STEP_S, Driven
from hil.hide.manoeuvres import TICK_S
from hil.hide.noise import QUANTUM, Noise, coloured
from hil.hide.strengths import S

Vector = NDArray[np.float64]
WHEELS = ("fl", "fr", "rl", "rr")
NODES = ("wheel", "imu", "pressure", "motor")
TEETH, TIMEOUT_S = 48, 0.5
SATELLITE_TICKS = 10


@dataclass(frozen=True)
class SensorFault:
    """One hidden sensor effect: strength per wheel or per node of `NODES` (one value where the car has one)."""

    strength: Vector
    onset_s: float = 0.0


Faults = Mapping[str, SensorFault]


def observe(
    driven: Driven, noise: Noise, faults: Faults, seed: tuple[int, ...], clean: bool = False
) -> dict[str, Vector]:
    """Canonical columns of one log.

    Parameters
    ----------
    clean : leaves out noise, teeth and quantisation, but not the clocks: for pairs of runs.
    """
    rng = np.random.default_rng(seed)
    rows = len(driven.states) // round(TICK_S / STEP_S) - 1
    true_t, cycle = driven.t_s, np.arange(rows, dtype=np.float64) * TICK_S
    times = [cycle + late + rng.exponential(noise.queue_s, rows) for late in noise.latency_s]
    stamp = np.maximum.accumulate(times[0] + np.arange(rows) * 1e-9)
    sampled = [_sampled(node, times[k], faults, rng) for k, node in enumerate(NODES)]
    add = 0.0 if clean else 1.0

    def state(first: int, t: Vector, columns: int = 1) -> Vector:
        values = [np.interp(t, true_t, driven.states[:, first + i]) for i in range(columns)]
        return np.stack(values, axis=1)

    def fault(name: str, columns: int = 4) -> Vector:
        """Strength over the rows, zero before the onset, (rows, columns)."""
        found = faults.get(name)
        if found is None:
            return np.zeros((rows, columns))
        return np.where(cycle[:, None] >= found.onset_s, found.strength[None, :columns], 0.0)

    scale = 1.0 + fault("wrong_scale")
    table: dict[str, Vector] = {"t_s": stamp}

    omega = state(S.omega_rad_s, sampled[0], 4)
    angle = state(S.angle_rad, sampled[0], 4)
    speed = omega if clean else _from_teeth(driven, sampled[0])
    once = np.stack([_wandering(angle[:, i], noise.order_share, rng) for i in range(4)], axis=1)
    once += _drifts(rows, 4, noise.wheel_drift, noise.sensor_tau_s, rng)
    white = rng.standard_normal((rows, 4)) * (noise.wheel_rad_s + noise.wheel_share * np.abs(omega))
    turning = speed > 0.05
    speed = speed * (1.0 + fault("wheel_tooth_error") * np.cos(angle)) + add * turning * (white + once * omega)
    speed = np.where(np.abs(speed) * 0.308 < fault("wheel_speed_lowv", 1), 0.0, speed)
    _put(table, "wheel_speed", "rad_s", _whole(speed * scale[:, :1], QUANTUM["wheel"], clean))

    felt = state(S.imu_ax_mps2, sampled[1], 3)
    lag = fault("imu_filter", 1)[-1, 0]
    if lag > 0.0:
        felt = _low_pass(felt, lag)
    felt = felt + add * rng.standard_normal((rows, 3)) * (noise.ax_mps2, noise.ay_mps2, noise.yaw_rad_s)
    felt[:, :1] += add * _drifts(rows, 1, noise.drift_mps2, noise.drift_tau_s, rng)
    felt[:, 1:2] += add * _drifts(rows, 1, noise.ay_drift_mps2, noise.sensor_tau_s, rng)
    felt[:, 2:] += add * _drifts(rows, 1, noise.yaw_drift_rad_s, noise.sensor_tau_s, rng)
    felt[:, 0] = felt[:, 0] * (1.0 + fault("imu_gain", 1)[:, 0]) + fault("imu_bias", 1)[:, 0]
    felt = felt * scale[:, 1:2]
    step = fault("quantisation", 1)[-1, 0]
    table["ax_mps2"] = _whole(felt[:, 0], max(QUANTUM["ax"], step), clean and step == 0.0)
    table["ay_mps2"] = _whole(felt[:, 1], max(QUANTUM["ay"], step), clean and step == 0.0)
    table["yaw_rate_rad_s"] = _whole(felt[:, 2], QUANTUM["yaw"], clean)

    pressure = state(S.pressure_pa, sampled[2], 4) + add * noise.pressure_pa * rng.standard_normal((rows, 4))
    pressure += add * _drifts(rows, 4, noise.pressure_drift_pa, noise.sensor_tau_s, rng)
    pressure = pressure * (1.0 + fault("pressure_gain")) + fault("pressure_offset")
    _put(table, "pressure", "pa", _whole(pressure * scale[:, 2:3], QUANTUM["pressure"], clean))
    demand = driven.manoeuvre.pressure_pa[:rows]
    _put(table, "pressure_demand", "pa", _whole(demand, QUANTUM["pressure"], clean))

    torque = state(S.motor_nm, sampled[3], 4) + add * noise.torque_nm * rng.standard_normal((rows, 4))
    torque += add * _drifts(rows, 4, noise.torque_drift_nm, noise.sensor_tau_s, rng)
    _put(table, "motor_torque", "nm", _whole(torque * scale[:, 3:4], QUANTUM["motor"], clean))
    _put(table, "motor_torque_demand", "nm", _whole(driven.motor_demand_nm[:rows], QUANTUM["motor"], clean))

    table["steer_rad"] = driven.manoeuvre.steering_wheel_rad[:rows] + add * 0.0005 * rng.standard_normal(rows)
    table["soc"] = _whole(state(S.state_of_charge, cycle)[:, 0], 0.001, clean)
    ground = state(S.speed_mps, cycle)[:, 0] + add * noise.speed_mps * rng.standard_normal(rows)
    ground = _whole(ground * (1.0 + fault("speed_scale", 1)[:, 0]), QUANTUM["speed"], clean)
    table["speed_mps"] = np.where(np.arange(rows) % SATELLITE_TICKS == 0, ground, np.nan)

    for k, node in enumerate(NODES):
        share = fault("frame_drop")[:, k]
        lost = rng.random(rows) < share
        if lost.any():
            _hold(table, node, lost)
    return table


def _sampled(node: str, t: Vector, faults: Faults, rng: np.random.Generator) -> Vector:
    """When the value on a row was taken: s(t - d), a clock that drifts, a bus that makes frames wait."""
    k = NODES.index(node)
    result = t
    for name in ("timestamp_offset", "clock_drift", "jitter"):
        found = faults.get(name)
        if found is None or found.strength[k] == 0.0:
            continue
        size = np.where(t >= found.onset_s, found.strength[k], 0.0)
        if name == "clock_drift":
            size = size * (t - t[0])
        elif name == "jitter":
            size = size * rng.exponential(1.0, len(t))
        result = result - size
    return result


def _from_teeth(driven: Driven, t: Vector) -> Vector:
    """Speed from the teeth that pass within 10 ms around each time; none for half a second is standstill.

    The angle between the last tooth before the window's end and the last one before its start, over the time between.
    """
    pitch, true_t = 2.0 * pi / TEETH, driven.t_s
    speeds = np.zeros((len(t), 4))
    for i in range(4):
        angle = np.maximum.accumulate(driven.states[:, S.angle_rad + i])
        angle = angle + 1e-12 * np.arange(len(angle))
        passed = np.interp(np.arange(1, int(angle[-1] / pitch) + 1) * pitch, angle, true_t)
        if len(passed) < 2:
            continue
        last, first = (np.searchsorted(passed, t + side * 0.5 * TICK_S, side="right") - 1 for side in (1.0, -1.0))
        count = last - first
        ok = (count > 0) & (first >= 0)
        span = passed[np.maximum(last, 0)] - passed[np.maximum(first, 0)]
        speed = np.where(ok, count * pitch / np.where(ok, span, 1.0), np.nan)
        if driven.manoeuvre.speed_mps > 0.0:  # a car that rolled before the log began
            speed[: int(np.argmax(ok))] = speed[int(np.argmax(ok))]
        held = np.maximum.accumulate(np.where(np.isfinite(speed), np.arange(len(t)), 0))
        waited = np.maximum(t + 0.5 * TICK_S - passed[np.maximum(last, 0)], 1e-3)
        least = np.where(waited > TIMEOUT_S, 0.0, np.minimum(np.nan_to_num(speed[held]), pitch / waited))
        speeds[:, i] = np.where(np.isfinite(speed), speed, least)
    return speeds


def _wandering(angle: Vector, share: float, rng: np.random.Generator) -> Vector:
    """Once-per-revolution error whose amplitude and phase wander over some revolutions."""
    cosine, sine = (coloured(len(angle), share, 0.3, TICK_S, rng) for _ in range(2))
    return cosine * np.cos(angle) + sine * np.sin(angle)


def _drifts(rows: int, columns: int, deviation: float, tau_s: float, rng: np.random.Generator) -> Vector:
    return np.stack([coloured(rows, deviation, tau_s, TICK_S, rng) for _ in range(columns)], axis=1)


def _low_pass(values: Vector, tau_s: float) -> Vector:
    keep = float(np.exp(-TICK_S / tau_s))
    start = values[:1] * keep
    filtered, _ = lfilter([1.0 - keep], [1.0, -keep], values, axis=0, zi=start)
    return np.asarray(filtered, dtype=np.float64)


def _whole(values: Vector, quantum: float, clean: bool) -> Vector:
    return values if clean else np.round(values / quantum) * quantum


def _put(table: dict[str, Vector], stem: str, unit: str, values: Vector) -> None:
    for i, wheel in enumerate(WHEELS):
        table[f"{stem}_{wheel}_{unit}"] = values[:, i]


def _hold(table: dict[str, Vector], node: str, lost: NDArray[np.bool_]) -> None:
    """Repeat the last frame that came."""
    stems = {
        "wheel": ("wheel_speed_",),
        "imu": ("ax_", "ay_", "yaw_"),
        "pressure": ("pressure_",),
        "motor": ("motor_torque_",),
    }
    lost = lost.copy()
    lost[0] = False
    source = np.maximum.accumulate(np.where(lost, 0, np.arange(len(lost))))
    for name in table:
        if name.startswith(stems[node]) and "demand" not in name:
            table[name] = table[name][source]

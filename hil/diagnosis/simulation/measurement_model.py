"""Measurement model: from plant states to channels as logged, by sensors, latency, toothed wheels and sampling.

Takes columns of the plant, (rows, columns), and a parameter set; gives `Stack`, channels by group. Latencies of
measured inputs are taken back here too (`without_latency`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from hil.diagnosis.compiled import compiled
from hil.diagnosis.data.dataset import ROW_S, SLOW_MPS, Recording
from hil.diagnosis.data.grid import averaged, cubic, shifted, shifted_linear, upsampled
from hil.diagnosis.data.log import Floats
from hil.diagnosis.simulation.parameter_set import ParameterSet
from hil.diagnosis.simulation.sensors import NODE, after_sensors
from hil.diagnosis.vehicle.latency import LATENCY_NODES
from plant.injection.sensing_chain import Chain
from plant.parameters.plant import PlantParameters
from plant.vectors import INPUT, P

_WHEELS = ("fl", "fr", "rl", "rr")
SOURCE = {
    "wheel": [f"state.wheel_speed_rad_s_{wheel}" for wheel in _WHEELS],
    "pressure": [f"state.pressure_pa_{wheel}" for wheel in _WHEELS],
    "motor": [f"state.motor_torque_nm_{wheel}" for wheel in _WHEELS],
    "ax": ["state.imu_longitudinal_mps2"],
    "ay": ["state.imu_lateral_mps2"],
    "yaw": ["state.imu_yaw_rate_rad_s"],
    "gps": ["state.speed_mps"],
}
"""Columns of the plant that each group of channels measures."""
Stack = dict[str, Floats]
"""Channels by group, (samples of all recordings, channels)."""
_LATE = {
    "ax": ("imu",), "ay": ("imu",), "yaw": ("imu", "yaw_rate"), "pressure": ("pressure",), "motor": ("motor",),
    "gps": ("ground_speed",),
}  # fmt: skip
"""Nodes whose latencies each group has."""
_USUAL_RADIUS_M = 0.3
_TOOTH_ROWS, _TURNS_RAD_S = 2.0, 0.1
_FADING_MPS, _LEAST_NM = 0.3, 1.0
_DIVERGED = 1e9
"""Largest value of a channel, SI: no pressure, torque or speed of a car comes near."""
_TURNS_MPS2, _CHARACTERISTIC_MPS = 0.3, (8.0, 200.0)
_FINER = 4
"""Points per row between which a motor's torque is linear: its lag bends it, and a straight line from row to row would
come 1.3 ms late."""

_MEASURED = (("pressure_pa", "pressure"), ("motor_torque_nm", "motor"), ("motor_torque_bend_nm", "motor"))
_DEMANDS = (("pressure_demand_pa", "pressure_demand"), ("motor_demand_nm", "motor_demand"))
_STEERING = INPUT.slice("steering_wheel_rad")


@dataclass(frozen=True)
class MeasurementModel:
    """Channels of a dataset.

    Attributes
    ----------
    groups : of channels.  parameters : the nominal vehicle's (teeth, radius).
    characteristic_mps : of the car's turning (`powers`), m/s.
    """

    groups: Sequence[str]
    parameters: PlantParameters
    characteristic_mps: float

    def split(self, table: Floats) -> Stack:
        """Columns of the plant, (rows, columns), by group."""
        stack: Stack = {}
        at = 0
        for group in self.groups:
            width = len(SOURCE[group])
            stack[group] = table[:, at : at + width]
            at += width
        return stack

    def measure(self, recording: Recording, parameters: ParameterSet, table: Floats) -> Stack:
        """Channels by sample, (samples, channels), from columns of the plant, (rows, columns).

        Those of a car that diverges are NaN: no sensor, and no place in a table, is worked out from infinite speeds.
        """
        if not -_DIVERGED < table.min() <= table.max() < _DIVERGED:
            nothing = np.full_like(table, np.nan)
            return {group: averaged(values, recording.stride) for group, values in self.split(nothing).items()}
        stack = self.measure_rows(self.split(table), recording, parameters)
        channels = {group: averaged(values, recording.stride) for group, values in stack.items()}
        if "wheel" in channels:
            self._at_measured_speed(channels, recording)
        return channels

    def measure_rows(self, true: Stack, recording: Recording, parameters: ParameterSet) -> Stack:
        """Channels row by row, as sensors and frames give the ``true`` ones."""
        chain = Chain(parameters.theta_in(recording), in_time=True)
        others = {group: values for group, values in true.items() if group != "motor"}
        stack = after_sensors(others, chain, ROW_S) if others else {}
        for group, values in stack.items():
            late = _late_rows(parameters, chain, group, len(values))
            if group == "wheel":
                half_turned = np.pi / self.parameters.sensor.teeth / ROW_S
                stack[group] = np.empty_like(values)
                toothed(values, parameters.window_rows2, half_turned, parameters.tooth_share, late, stack[group])
            elif late.any():
                stack[group] = delayed(values, late, straight=group == "pressure")
        if "motor" in true:
            fine = _finer(true["motor"], recording.inputs[:, INPUT.slice("motor_torque_bend_nm")])
            fine = after_sensors({"motor": fine}, chain, ROW_S / _FINER)["motor"]
            stack["motor"] = np.empty_like(true["motor"])
            shifted_linear(
                fine, _FINER, _FINER * _late_rows(parameters, chain, "motor", len(fine) // _FINER), stack["motor"]
            )
        return stack

    def _at_measured_speed(self, channels: Stack, recording: Recording) -> None:
        """Turn the car, in place, as at the measured speed."""
        factors = np.empty((2, len(channels["wheel"])))
        radius_m = self.parameters.wheel.rolling_radius_m
        faster_turning(recording.measured["wheel"], channels["wheel"], radius_m, self.characteristic_mps, factors)
        for group, factor in zip(("ay", "yaw"), factors, strict=True):
            if group in channels:
                channels[group] *= factor[:, None]


@compiled
def powers(speed_mps: Floats, characteristic_mps: float) -> tuple[Floats, Floats]:
    """Powers of the speed that lateral acceleration and yaw rate go with at a given steering angle.

    Of the linear single-track model, a_y = v^2 delta / (l (1 + v^2 / v_ch^2)) (Mitschke and Wallentowitz 2014,
    Dynamik der Kraftfahrzeuge, sec. 27).
    """
    squared = (speed_mps / characteristic_mps) ** 2
    return 2.0 / (1.0 + squared), (1.0 - squared) / (1.0 + squared)


@compiled
def faster_turning(measured: Floats, omega: Floats, radius_m: float, characteristic_mps: float, out: Floats) -> None:
    """Factors of lateral acceleration and yaw rate, (2, samples), from the simulated to the measured speed, into
    ``out``; both speeds are (samples, wheels), rad/s."""
    wheels = omega.shape[1]
    for t in range(omega.shape[0]):
        faster, mean = 0.0, 0.0
        for k in range(wheels):
            difference = measured[t, k] - omega[t, k]
            faster += difference / wheels if difference == difference else 0.0
            mean += omega[t, k] / wheels
        turning = np.copysign(max(abs(mean), SLOW_MPS / _USUAL_RADIUS_M), mean)
        share = min(max(faster / turning, -0.2), 0.2)
        lateral, yaw = powers(turning * radius_m, characteristic_mps)
        out[0, t] = 1.0 + lateral * share
        out[1, t] = 1.0 + yaw * share


def _finer(torque_nm: Floats, bend_nm: Floats) -> Floats:
    """Torque at `_FINER` points per row: parabolas that are off the straight line by ``bend_nm`` in the middle."""
    out = np.empty((len(torque_nm) * _FINER, torque_nm.shape[1]))
    upsampled(torque_nm, bend_nm, out)
    return out


@compiled
def toothed(
    omega: Floats, window_rows2: float, half_pitch: float, share: float, late: Floats, out: Floats
) -> None:  # fmt: skip
    """Speeds (rows, wheels) as toothed wheels measure them, when a tooth has passed, ``late`` rows later, into ``out``.

    ``half_pitch`` is half the angle between two teeth, rad rows/s: a speed comes later by a ``share`` of the time that
    takes, two rows at most. It is a mean over a window of squared width ``window_rows2``, by its second derivative.
    """
    last, mean = omega.shape[0] - 1, omega.copy()
    for t in range(1, last):
        for k in range(omega.shape[1]):
            mean[t, k] += window_rows2 / 24.0 * (omega[t + 1, k] - 2.0 * omega[t, k] + omega[t - 1, k])
    for t in range(omega.shape[0]):
        for k in range(omega.shape[1]):
            speed = omega[t, k] if late[t] == 0.0 else cubic(omega, k, t - late[t])
            rows = min(half_pitch / max(abs(speed), _TURNS_RAD_S), _TOOTH_ROWS)
            out[t, k] = cubic(mean, k, t - late[t] - share * rows)


def delayed(values: Floats, late: Floats, straight: bool = False) -> Floats:
    """Channels, (rows, columns), each row ``late`` (rows,) of them later.

    ``straight`` lines between rows for what has corners, as a motor at its rate limit; else parabolas
    (`hil.diagnosis.data.grid`).
    """
    out = np.empty(values.shape)
    if straight:
        shifted_linear(values, 1, late, out)
    else:
        shifted(values, late, out)
    return out


def held_later(values: Floats, rows: float) -> Floats:
    """Held values, (rows, columns), that change some rows later (earlier where negative), as the mean over each row."""
    whole, share = divmod(rows, 1.0)
    at = np.arange(len(values)) - int(whole)
    last = len(values) - 1
    now, before = values[np.clip(at, 0, last)], values[np.clip(at - 1, 0, last)]
    return np.asarray(now + share * (before - now))


def _late_rows(parameters: ParameterSet, chain: Chain, group: str, rows: int) -> Floats:
    """How many rows a channel comes late, (rows,), by latency and stamps: one shift, as lines between rows would smooth
    a jump twice."""
    late = sum(parameters.latency_s[LATENCY_NODES.index(node)] for node in _LATE.get(group, ()))
    time_s: Floats = np.arange(rows) * ROW_S
    return np.asarray((late + chain.late_s(NODE[group], time_s)) / ROW_S)


def without_latency(inputs: Floats, late_s: tuple[float, ...], theta: Floats) -> Floats:
    """Measured inputs, (rows, INPUT.size), with their nodes' latency (s) taken back; demands when they are acted on.

    ``late_s`` are the latencies of `LATENCY_NODES`, s; stamps are late by ``theta``.
    """
    chain = Chain(theta, in_time=True)
    time_s: Floats = np.arange(len(inputs)) * ROW_S
    rows = {node: late / ROW_S + np.zeros(len(inputs)) for node, late in zip(LATENCY_NODES, late_s, strict=True)}
    for node in ("pressure", "motor"):
        rows[node] += chain.late_s(node, time_s) / ROW_S
    rows = {node: late for node, late in rows.items() if late.any()}
    if not rows:
        return inputs
    moved = inputs.copy()
    if "steering" in rows:
        moved[:, _STEERING] = delayed(inputs[:, _STEERING], rows["steering"])
    for part, node in _DEMANDS:
        if node in rows:
            moved[:, INPUT.slice(part)] = held_later(inputs[:, INPUT.slice(part)], rows[node][0])
    for part, node in _MEASURED:
        if node in rows:
            moved[:, INPUT.slice(part)] = delayed(inputs[:, INPUT.slice(part)], -rows[node], straight=True)
    return moved


def without_fading_motors(recording: Recording, parameters: ParameterSet) -> Stack:
    """Measured channels without motors whose braking fades: there it answers errors of speed no sensor resolves.

    Which way a wheel at rest creeps is such an error, too: there any torque may be taken for one that brakes.
    """
    if not {"motor", "wheel"} <= set(recording.measured):
        return recording.measured
    speed = np.nan_to_num(recording.measured["wheel"]) * float(parameters.p[P.wheel_rolling_radius_m])
    demand = averaged(recording.inputs[:, INPUT.slice("motor_demand_nm")], recording.stride)
    brakes = (speed < float(parameters.p[P.motor_fade_start_mps]) + _FADING_MPS) & (demand < -_LEAST_NM)
    fades = brakes | ((np.abs(speed) < _FADING_MPS) & (np.abs(demand) > _LEAST_NM))
    return {**recording.measured, "motor": np.where(fades, np.nan, recording.measured["motor"])}


def characteristic_speed(one: Stack, other: Stack, parameters: ParameterSet) -> float:
    """Characteristic speed of `powers`, m/s: how lateral acceleration goes with a small difference of the speed.

    ``one`` and ``other`` are plant columns of one car at slightly different speeds; infinite where it runs straight.
    """
    wheel = one["wheel"].mean(axis=1)
    v = wheel * float(parameters.p[P.wheel_rolling_radius_m])
    turning = (np.abs(one["ay"][:, 0]) > _TURNS_MPS2) & (v > SLOW_MPS)
    ay, v, faster = one["ay"][turning, 0], v[turning], (other["wheel"] - one["wheel"]).mean(axis=1)[turning]
    if not len(ay):
        return np.inf
    share = faster / wheel[turning]

    def misfit(log_speed: float) -> float:
        predicted = ay * share * powers(v, np.exp(log_speed))[0]
        return float(np.sum(((other["ay"] - one["ay"])[turning, 0] - predicted) ** 2))

    return float(np.exp(minimize_scalar(misfit, bounds=np.log(_CHARACTERISTIC_MPS), method="bounded").x))

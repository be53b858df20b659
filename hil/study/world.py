"""The car in the study: parameters, effects and sensing, replayed freely over all drives, many cars at once."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import savgol_filter

from hil.study.prepare import ROW_S, Case, Drive, averaged
from hil.study.sensing import inverted, sensed
from hil.study.table import Floats
from hil.study.vehicle import Nuisance, Vehicle, rest_friction
from plant.effects.bank import NO_TERMS
from plant.effects.plugin import NO_PLUGINS
from plant.effects.theta import THETA
from plant.integrate import SEMI_IMPLICIT
from plant.model import column_indices, healthy, initial_state, simulate
from plant.road import DRY, road_table
from plant.vectors import INPUT, OUTPUT, STATE, P, X

STEPS = 4
WORKERS = 2
DISC_K = 350.0
_SUFFIX = ("fl", "fr", "rl", "rr")
_SOURCE = {
    "wheel": [f"state.wheel_speed_rad_s_{wheel}" for wheel in _SUFFIX],
    "pressure": [f"state.pressure_pa_{wheel}" for wheel in _SUFFIX],
    "motor": [f"state.motor_torque_nm_{wheel}" for wheel in _SUFFIX],
    "ax": ["state.imu_longitudinal_mps2"],
    "ay": ["state.imu_lateral_mps2"],
    "yaw": ["state.imu_yaw_rate_rad_s"],
    "gps": ["state.speed_mps"],
}
Stack = dict[str, Floats]
"""Channels by group, (samples of all drives, channels)."""


@dataclass(frozen=True, eq=False)
class World:
    """One car: flat parameters, theta, basis terms (rows as in `plant.effects.bank`), discs at the start, latencies."""

    p: Floats
    theta: Floats
    terms: Floats = field(default_factory=NO_TERMS.copy)
    disc_offset_k: float = 0.0
    late_s: tuple[float, ...] = (0.0, 0.0, 0.0)

    def shifted(self, nuisances: Sequence[Nuisance], z: Floats) -> "World":
        """With nuisances ``z`` standard deviations off."""
        p, disc, late = self.p.copy(), self.disc_offset_k, list(self.late_s)
        for nuisance, amount in zip(nuisances, z, strict=True):
            for at, step in zip(nuisance.at, nuisance.step, strict=True):
                if nuisance.kind == "disc":
                    disc += amount * step
                elif nuisance.kind == "late":
                    late[at] += amount * step
                else:
                    p[at] = _within(p[at], p[at] + amount * step)
        return replace(self, p=p, disc_offset_k=disc, late_s=tuple(late))


LATE = ("imu", "pressure", "motor")
"""Nodes whose frames may come later than the wheel speeds'."""
_NODE = {"ax": 0, "ay": 0, "yaw": 0, "pressure": 1, "motor": 2}


def start_nuisances() -> list[Nuisance]:
    """What the logs, not the vehicle, leave open: temperature of the discs, latency of the nodes."""
    found = [Nuisance(f"late_{node}", (k,), (2e-3,), "late") for k, node in enumerate(LATE)]
    return [Nuisance("disc_temperature_k", (0,), (15.0,), "disc"), *found]


def _within(now: float, wanted: float) -> float:
    """Never through zero, nor beyond five times."""
    return float(np.clip(wanted, 0.1 * now, 5.0 * now)) if now > 0.0 else wanted


def nominal(vehicle: Vehicle) -> World:
    """The car as handed in."""
    return World(vehicle.p, THETA.neutral())


_INPUTS = (("pressure", "pressure_pa"), ("motor", "motor_torque_nm"))
_SMOOTH = 13  # rows of 10 ms
_OF_THE_ROAD = (("road_grade", "grade"), ("headwind", "wind_mps"))


def _along(theta: Floats, direction: int) -> Floats:
    """Theta as met when driving along the road (+1) or back (-1)."""
    if direction > 0:
        return theta
    turned = theta.copy()
    for effect, parameter in _OF_THE_ROAD:
        turned[THETA.slice(effect, parameter)] *= -1.0
    return turned


def _later(values: Floats, rows: float) -> Floats:
    """Channels as seen a fraction of a row later."""
    slope = np.gradient(values, axis=0)
    return np.asarray(values - rows * slope)


def _earlier(inputs: Floats, late_s: tuple[float, ...]) -> Floats:
    """Measured inputs with their nodes' latency taken back."""
    if late_s[1] == 0.0 and late_s[2] == 0.0:
        return inputs
    moved = inputs.copy()
    for part, late in (("pressure_pa", late_s[1]), ("motor_torque_nm", late_s[2])):
        where = INPUT.slice(part)
        moved[:, where] = _later(inputs[:, where], -late / ROW_S)
    return moved


class Rig:
    """Replays worlds over the drives of a case."""

    def __init__(self, case: Case, vehicle: Vehicle) -> None:
        self.case, self.vehicle = case, vehicle
        self._groups = case.groups
        names = [name for group in case.groups for name in _SOURCE[group]]
        self._columns = column_indices(names)
        self._road = road_table(DRY)
        self.runs = 0

    def quieted(self, world: World) -> "Rig":
        """A rig whose measured pressures and motor torques are rid of noise.

        What drives the car is the simulated value plus the smoothed difference of the measured one: steps stay sharp.
        """
        wanted = [(group, part) for group, part in _INPUTS if group in self._groups]
        drives = []
        for drive in self.case.drives:
            raw = self._raw(drive, world)
            inputs = drive.inputs.copy()
            for group, part in wanted:
                where = INPUT.slice(part)
                apart = drive.inputs[:, where] - raw[group]
                window = min(_SMOOTH, (len(apart) - 1) // 2 * 2 + 1)
                inputs[:, where] = raw[group] + savgol_filter(apart, window, 2, axis=0)
            drives.append(replace(drive, inputs=inputs))
        return Rig(replace(self.case, drives=tuple(drives)), self.vehicle)

    def run(self, world: World) -> Stack:
        """Simulated channels of all drives."""
        self.runs += 1
        parts = [self._drive(drive, world) for drive in self.case.drives]
        return {group: np.concatenate([part[group] for part in parts]) for group in self._groups}

    def run_all(self, worlds: Sequence[World]) -> Iterator[Stack]:
        """Of many worlds, in order, over threads."""
        with ThreadPoolExecutor(WORKERS) as pool:
            yield from pool.map(self.run, worlds)

    def residual(self, world: World) -> Stack:
        """Measured less simulated, (samples, channels, 1); NaN where nothing is measured."""
        simulated = self.run(world)
        return {group: (measured - simulated[group])[:, :, None] for group, measured in self.measured().items()}

    def measured(self) -> Stack:
        """Measured channels of all drives."""
        return {g: np.concatenate([drive.measured[g] for drive in self.case.drives]) for g in self._groups}

    def _start(self, drive: Drive, world: World) -> Floats:
        log, first = drive.log, drive.segments[0]
        soc = log.channels.get("soc")
        charge = 0.7 if soc is None else float(np.nanmean(soc[:20]))
        disc = (log.disc_temperature_k or DISC_K) + world.disc_offset_k
        x = initial_state(self.vehicle.parameters, 0.0, disc, charge)
        if not self.vehicle.pad_temperature_matters:
            ambient = float(world.p[P.friction_brake_ambient_k])
            x[STATE.slice("pad_temperature_k")] = ambient
            x[STATE.slice("pad_friction")] = rest_friction(self.vehicle.parameters, ambient)
        speed = self._speed(first.start_wheel_rad_s, first.start_speed_mps, world)
        x[X.speed_mps] = speed
        x[STATE.slice("wheel_speed_rad_s")] = speed / world.p[P.wheel_rolling_radius_m]
        x[STATE.slice("pressure_pa")] = np.clip(drive.inputs[0, INPUT.slice("pressure_pa")], 0.0, None)
        x[STATE.slice("motor_torque_nm")] = drive.inputs[0, INPUT.slice("motor_torque_nm")]
        return x

    def _speed(self, wheel_rad_s: float, ground_mps: float | None, world: World) -> float:
        if ground_mps is not None:
            return max(ground_mps, 0.0)
        return max(wheel_rad_s, 0.0) * float(world.p[P.wheel_rolling_radius_m])

    def _drive(self, drive: Drive, world: World) -> Stack:
        stack = sensed(self._raw(drive, world), _along(world.theta, drive.log.direction), ROW_S)
        for group, values in stack.items():
            late = world.late_s[_NODE[group]] if group in _NODE else 0.0
            if late:
                stack[group] = _later(values, late / ROW_S)
        return {group: averaged(values, drive.stride) for group, values in stack.items()}

    def _raw(self, drive: Drive, world: World) -> Stack:
        x = self._start(drive, world)
        theta = _along(world.theta, drive.log.direction)
        inputs = inverted(drive.inputs, theta, ROW_S)
        inputs = _earlier(inputs, world.late_s)
        table = np.empty((len(inputs), len(self._columns)))
        cut, switch, y = self.case.cut, healthy(), OUTPUT.zeros()
        for number, segment in enumerate(drive.segments):
            if number:
                self._restart(x, self._speed(segment.start_wheel_rad_s, segment.start_speed_mps, world))
            simulate(
                x, inputs[segment.first : segment.last], cut, switch, world.p, self._road, ROW_S / STEPS, STEPS,
                SEMI_IMPLICIT, self._columns, table[segment.first : segment.last], y, theta, world.terms, NO_PLUGINS,
            )  # fmt: skip
        stack: Stack = {}
        at = 0
        for group in self._groups:
            width = len(_SOURCE[group])
            stack[group] = table[:, at : at + width]
            at += width
        return stack

    @staticmethod
    def _restart(x: Floats, speed_mps: float) -> None:
        """The measured speed with the slips as they are; temperatures, friction, energy and pitch go on."""
        now = x[X.speed_mps]
        wheels = STATE.slice("wheel_speed_rad_s")
        if not np.isfinite(x).all():
            x[~np.isfinite(x)] = 0.0
        ratio = speed_mps / now if now > 0.5 else 1.0
        x[wheels] *= ratio
        if now <= 0.5:
            x[wheels] += (speed_mps - now) / 0.3
        if speed_mps < 0.1:
            x[wheels] = 0.0
        x[X.speed_mps] = speed_mps
        for name in ("lateral_speed_mps", "yaw_rate_rad_s"):
            x[STATE.slice(name)] *= ratio if now > 0.5 else 0.0

"""The car in the study: parameters, effects and sensing, replayed freely over all drives, many cars at once."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from hil.study.prepare import ROW_S, SLOW_MPS, Case, Drive, Segment, averaged
from hil.study.sensing import WATCHING, inverted, sensed, wheel_speed_before
from hil.study.table import Floats
from hil.study.vehicle import Nuisance, Vehicle, factor_of, rest_friction
from plant.effects.bank import NO_TERMS
from plant.effects.plugin import NO_PLUGINS
from plant.effects.theta import THETA
from plant.integrate import EXPONENTIAL_4
from plant.model import column_indices, healthy, initial_state, simulate
from plant.road import DRY, road_table
from plant.vectors import INPUT, OUTPUT, STATE, P, X

STEPS = 2
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
    """One car: flat parameters, theta, basis terms (rows as in `plant.effects.bank`), discs at the start, latencies.

    ``onsets`` names effects that begin in the middle: number of the drive, and s in it.
    ``tooth_share`` multiplies the lag of a toothed wheel, half the time between two teeth: the speed is told when a
    tooth has passed.
    """

    p: Floats
    theta: Floats
    terms: Floats = field(default_factory=NO_TERMS.copy)
    disc_offset_k: float = 0.0
    late_s: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    tooth_share: float = 1.0
    onsets: tuple[tuple[str, int, float], ...] = ()

    def theta_in(self, drive: Drive) -> Floats:
        """Theta of one drive: direction along the road, and what begins later or within it."""
        theta = _along(self.theta, drive.log.direction)
        if self.onsets:
            theta = theta.copy()
        for name, number, since_s in self.onsets:
            if drive.number < number:
                for parameter in THETA.effect(name).strengths:
                    theta[THETA.slice(name, parameter.name)] = 0.0
            elif drive.number == number:
                theta[THETA.slice(name, "onset_s")] = since_s
        return theta

    def shifted(self, nuisances: Sequence[Nuisance], z: Floats) -> "World":
        """With nuisances ``z`` standard deviations off."""
        p, disc, late, tooth = self.p.copy(), self.disc_offset_k, list(self.late_s), self.tooth_share
        for nuisance, amount in zip(nuisances, z, strict=True):
            for at, step in zip(nuisance.at, nuisance.step, strict=True):
                if nuisance.kind == "disc":
                    disc += amount * step
                elif nuisance.kind == "late":
                    late[at] += amount * step
                elif nuisance.kind == "tooth":
                    tooth += amount * step
                elif nuisance.kind == "signed":
                    p[at] += amount * step
                else:
                    p[at] = _positive(p[at], amount, step)
        return replace(self, p=p, disc_offset_k=disc, late_s=tuple(late), tooth_share=tooth)


LATE = ("imu", "pressure", "motor", "demand")
"""Nodes whose frames may come later than the wheel speeds'; demands may be acted on later than they are logged."""
_NODE = {"ax": 0, "ay": 0, "yaw": 0, "pressure": 1, "motor": 2}


def start_nuisances() -> list[Nuisance]:
    """What the logs, not the vehicle, leave open: temperature of the discs, latency of the nodes."""
    found = [Nuisance(f"late_{node}", (k,), (2e-3,), "late") for k, node in enumerate(LATE)]
    return [Nuisance("disc_temperature_k", (0,), (15.0,), "disc"), Nuisance("tooth_lag", (0,), (0.5,), "tooth"), *found]


def _positive(now: float, z: float, step: float) -> float:
    """A positive number ``z`` standard deviations off: it never goes through zero."""
    factor = factor_of(now, step)
    return float(now * factor ** (z * np.sign(step))) if factor > 1.0 else now + z * step


def nominal(vehicle: Vehicle) -> World:
    """The car as handed in."""
    return World(vehicle.p, THETA.neutral())


def _radius_m(world: World) -> Floats:
    """Rolling radius of each wheel, (4,), effects that change it included: no slip at the start that nobody drove."""
    worn = 1.0 + world.theta[THETA.slice("tyre_radius", "gain")]
    flat = 1.0 - 0.01 * world.theta[THETA.slice("tyre_pressure_loss", "share")]
    return np.asarray(float(world.p[P.wheel_rolling_radius_m]) * worn * flat)


_INPUTS = (("pressure", "pressure_pa"), ("motor", "motor_torque_nm"))
_SMOOTH = 21  # rows of 10 ms
_OF_THE_ROAD = (("road_grade", "grade"), ("headwind", "wind_mps"))


def _along(theta: Floats, direction: int) -> Floats:
    """Theta as met when driving along the road (+1) or back (-1)."""
    if direction > 0:
        return theta
    turned = theta.copy()
    for effect, parameter in _OF_THE_ROAD:
        turned[THETA.slice(effect, parameter)] *= -1.0
    return turned


def _later(values: Floats, rows: float | Floats) -> Floats:
    """Channels as seen some rows later, straight lines between rows."""
    last = len(values) - 1
    at = np.clip(np.arange(len(values))[:, None] - rows, 0.0, last) + np.zeros(values.shape)
    before = at.astype(np.intp)
    share = at - before
    column = np.arange(values.shape[1])
    return np.asarray((1.0 - share) * values[before, column] + share * values[np.minimum(before + 1, last), column])


def _held_later(values: Floats, rows: float) -> Floats:
    """Held values that change a fraction of a row later (earlier where negative), as the mean over each row."""
    change = np.diff(values, axis=0)
    moved = values.copy()
    if rows >= 0.0:
        moved[1:] -= min(rows, 1.0) * change
    else:
        moved[:-1] += min(-rows, 1.0) * change
    return moved


def _in_time(inputs: Floats, late_s: tuple[float, ...]) -> Floats:
    """Measured inputs with their nodes' latency taken back, demands when they are acted on."""
    if not any(late_s[1:]):
        return inputs
    moved = inputs.copy()
    for part in ("pressure_demand_pa", "motor_demand_nm"):
        where = INPUT.slice(part)
        moved[:, where] = _held_later(inputs[:, where], late_s[3] / ROW_S)
    for part, late in (("pressure_pa", late_s[1]), ("motor_torque_nm", late_s[2])):
        where = INPUT.slice(part)
        moved[:, where] = _later(inputs[:, where], -late / ROW_S)
    return moved


_SHORT, _SETTLED_ROWS = 0.97, 6
_LEAST_MPS, _STEEPEST_NMS_RAD = 0.2, 40.0
_USUAL_RADIUS_M = 0.3
_TOOTH_ROWS = 2.0


def speed_slope(torque_nm: Floats, demand_nm: Floats, omega_rad_s: Floats, world: World) -> Floats:
    """How the torque of motors that give less than demanded answers their speed, N m s/rad, (rows, 4).

    Regeneration that fades at low speed has T / (v - v0) per m/s, constant power (of motor or battery) -T / omega.
    """
    before = np.vstack((np.repeat(demand_nm[:1], _SETTLED_ROWS, axis=0), demand_nm[:-_SETTLED_ROWS]))
    short = np.abs(torque_nm) < _SHORT * np.minimum(np.abs(demand_nm), np.abs(before))
    radius = float(world.p[P.wheel_rolling_radius_m])
    speed = omega_rad_s * radius
    fades = short & (speed < world.p[P.motor_fade_start_mps]) & (torque_nm < 0.0)
    over = np.maximum(speed - float(world.p[P.motor_fade_end_mps]), _LEAST_MPS)
    power = np.where(short, -torque_nm / np.maximum(omega_rad_s, 1.0), 0.0)
    return np.asarray(np.where(fades, torque_nm / over * radius, power))


def _moves_alike(one: World, other: World) -> bool:
    """Whether two worlds differ in sensors that only watch, if at all."""
    apart = np.flatnonzero(one.theta != other.theta)
    return (
        (one.p is other.p or np.array_equal(one.p, other.p))
        and np.array_equal(one.terms, other.terms)
        and one.disc_offset_k == other.disc_offset_k
        and one.onsets == other.onsets
        and one.late_s[1:] == other.late_s[1:]
        and bool(np.isin(apart, WATCHING).all())
    )


class Rig:
    """Replays worlds over the drives of a case.

    Simulated motor torque and turning are those at the measured wheel speed: a motor at its limits and a car in a bend
    answer every error of the speed, whatever made it. ``slopes``, (samples, 4) a drive, say how motors do
    (`speed_slope`).
    """

    def __init__(self, case: Case, vehicle: Vehicle, slopes: Sequence[Floats] | None = None) -> None:
        self.case, self.vehicle, self._slopes = case, vehicle, slopes
        self._groups = case.groups
        names = [name for group in case.groups for name in _SOURCE[group]]
        self._columns = column_indices(names)
        self._road = road_table(DRY)
        self._kept: tuple[World, list[Stack]] | None = None
        self.runs = 0

    def quieted(self, world: World) -> "Rig":
        """A rig whose measured pressures and motor torques are rid of noise.

        What drives the car is the simulated value plus the smoothed difference of the measured one: steps stay sharp.
        """
        wanted = [(group, part) for group, part in _INPUTS if group in self._groups]
        drives, slopes = [], []
        for drive in self.case.drives:
            raw = self._raw(drive, world)
            inputs = drive.inputs.copy()
            for group, part in wanted:
                where = INPUT.slice(part)
                apart = drive.inputs[:, where] - raw[group]
                window = min(_SMOOTH, (len(apart) - 1) // 2 * 2 + 1)
                inputs[:, where] = raw[group] + savgol_filter(apart, window, 2, axis=0)
            measured = drive.measured
            if "motor" in measured and "wheel" in measured:
                demand = drive.inputs[:, INPUT.slice("motor_demand_nm")]
                slope = averaged(speed_slope(raw["motor"], demand, raw["wheel"], world), drive.stride)
                measured = {**measured, "motor": np.where(np.abs(slope) > _STEEPEST_NMS_RAD, np.nan, measured["motor"])}
                slopes.append(np.clip(slope, -_STEEPEST_NMS_RAD, _STEEPEST_NMS_RAD))
            drives.append(replace(drive, inputs=inputs, measured=measured))
        return Rig(replace(self.case, drives=tuple(drives)), self.vehicle, slopes or None)

    def run(self, world: World) -> Stack:
        """Simulated channels of all drives."""
        self.runs += 1
        parts = [self._drive(drive, world) for drive in self.case.drives]
        return {group: np.concatenate([part[group] for part in parts]) for group in self._groups}

    def keep(self, world: World) -> None:
        """Keep the motion of this world: one that differs in its sensors alone is not simulated again."""
        self._kept = world, [self._raw(drive, world) for drive in self.case.drives]

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
        speed = self._speed(drive, first, world)
        x[X.speed_mps] = speed
        x[STATE.slice("wheel_speed_rad_s")] = speed / _radius_m(world)
        x[STATE.slice("pressure_pa")] = np.clip(drive.inputs[0, INPUT.slice("pressure_pa")], 0.0, None)
        x[STATE.slice("motor_torque_nm")] = drive.inputs[0, INPUT.slice("motor_torque_nm")]
        return x

    def _speed(self, drive: Drive, segment: Segment, world: World) -> float:
        """Speed a segment starts with: what the sensors told, less what the world's sensors add."""
        if segment.start_speed_mps is not None:
            return max(segment.start_speed_mps, 0.0)
        told = wheel_speed_before(segment.start_wheel_rad_s, world.theta_in(drive))
        return max(told, 0.0) * float(np.median(_radius_m(world)))

    def _drive(self, drive: Drive, world: World) -> Stack:
        kept = self._kept
        raw = kept[1][drive.number] if kept is not None and _moves_alike(world, kept[0]) else self._raw(drive, world)
        stack = sensed(raw, world.theta_in(drive), ROW_S)
        for group, values in stack.items():
            late = world.late_s[_NODE[group]] if group in _NODE else 0.0
            if late:
                stack[group] = _later(values, late / ROW_S)
            elif group == "wheel" and world.tooth_share:
                stack[group] = _later(values, self._tooth_rows(values) * world.tooth_share)
        found = {group: averaged(values, drive.stride) for group, values in stack.items()}
        if "wheel" in found:
            self._at_measured_speed(found, drive, None if self._slopes is None else self._slopes[drive.number])
        return found

    def _tooth_rows(self, omega_rad_s: Floats) -> Floats:
        """Half the time between two teeth, rows; two rows at most."""
        pitch = 2.0 * np.pi / self.vehicle.parameters.sensor.teeth
        return np.minimum(0.5 * pitch / np.fmax(np.abs(omega_rad_s), 0.1) / ROW_S, _TOOTH_ROWS)

    def _at_measured_speed(self, found: Stack, drive: Drive, slope: Floats | None) -> None:
        """What answers the speed, as it is at the measured speed: limited motors, a_y as v^2, yaw rate as v."""
        faster = np.nan_to_num(drive.measured["wheel"] - found["wheel"])
        if slope is not None:
            found["motor"] += slope * faster
        share = faster.mean(axis=1) / np.maximum(found["wheel"].mean(axis=1), SLOW_MPS / _USUAL_RADIUS_M)
        share = np.clip(share, -0.2, 0.2)[:, None]
        for group, power in (("ay", 2.0), ("yaw", 1.0)):
            if group in found:
                found[group] *= 1.0 + power * share

    def states(self, world: World, names: Sequence[str]) -> Floats:
        """States and outputs by name (`plant.model.column_indices`) over all drives, (rows, names)."""
        columns = column_indices(list(names))
        return np.concatenate([self._replayed(drive, world, columns) for drive in self.case.drives])

    def _raw(self, drive: Drive, world: World) -> Stack:
        table = self._replayed(drive, world, self._columns)
        stack: Stack = {}
        at = 0
        for group in self._groups:
            width = len(_SOURCE[group])
            stack[group] = table[:, at : at + width]
            at += width
        return stack

    def _replayed(self, drive: Drive, world: World, columns: NDArray[np.int64]) -> Floats:
        """One drive, what ``columns`` ask for at every row."""
        x = self._start(drive, world)
        theta = world.theta_in(drive)
        inputs = inverted(drive.inputs, theta, ROW_S)
        inputs = _in_time(inputs, world.late_s)
        table = np.empty((len(inputs), len(columns)))
        cut, switch, y = self.case.cut, healthy(), OUTPUT.zeros()
        for number, segment in enumerate(drive.segments):
            if number:
                self._restart(x, self._speed(drive, segment, world))
            simulate(
                x, inputs[segment.first : segment.last], cut, switch, world.p, self._road, ROW_S / STEPS, STEPS,
                EXPONENTIAL_4, columns, table[segment.first : segment.last], y, theta, world.terms, NO_PLUGINS,
            )  # fmt: skip
        return table

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

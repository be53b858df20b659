"""What is driven: demands in the controller's place, one log a manoeuvre."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

TICK_S = 0.01
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Manoeuvre:
    """One log's drive, sampled every 10 ms.

    Attributes
    ----------
    name : of the log.  speed_mps : at the start.  disc_temperature_k : of all discs at the start.
    direction : along the road, +1 or -1.
    pressure_pa, motor_nm : demands, (n, 4).  steering_wheel_rad : (n,).
    hold_mps : speed the driver holds with the motors, NaN where the motors follow their demand.
    """

    name: str
    speed_mps: float
    disc_temperature_k: float
    direction: int
    pressure_pa: FloatArray
    motor_nm: FloatArray
    steering_wheel_rad: FloatArray
    hold_mps: FloatArray
    state_of_charge: float = 0.6

    @property
    def ticks(self) -> int:
        """How many samples of demands."""
        return len(self.hold_mps)


@dataclass
class _Drive:
    """A manoeuvre in the making."""

    name: str
    duration_s: float
    speed_mps: float
    disc_k: float = 350.0
    direction: int = 1
    pressure: dict[tuple[int, ...], Callable[[FloatArray], FloatArray]] = field(default_factory=dict)
    motor: dict[tuple[int, ...], Callable[[FloatArray], FloatArray]] = field(default_factory=dict)
    steer: Callable[[FloatArray], FloatArray] | None = None
    hold: Callable[[FloatArray], FloatArray] | None = None

    def made(self) -> Manoeuvre:
        t = np.arange(round(self.duration_s / TICK_S), dtype=np.float64) * TICK_S
        pressure, motor = np.zeros((t.size, 4)), np.zeros((t.size, 4))
        for wheels, function in self.pressure.items():
            pressure[:, wheels] += function(t)[:, None]
        for wheels, function in self.motor.items():
            motor[:, wheels] += function(t)[:, None]
        steer = self.steer(t) if self.steer else np.zeros(t.size)
        hold = self.hold(t) if self.hold else np.full(t.size, np.nan)
        return Manoeuvre(self.name, self.speed_mps, self.disc_k, self.direction, pressure, motor, steer, hold)


ALL, FRONT, REAR, LEFT, RIGHT = (0, 1, 2, 3), (0, 1), (2, 3), (0, 2), (1, 3)
BAR = 1e5


def _ramps(*points: tuple[float, float]) -> Callable[[FloatArray], FloatArray]:
    times, values = zip(*points, strict=True)
    return lambda t: np.interp(t, times, values)


def _steps(*points: tuple[float, float]) -> Callable[[FloatArray], FloatArray]:
    times, values = np.array([p[0] for p in points]), np.array([0.0] + [p[1] for p in points])
    return lambda t: np.asarray(values[np.searchsorted(times, t, side="right")], dtype=np.float64)


def _triangles(start_s: float, period_s: float, count: int, high: float) -> Callable[[FloatArray], FloatArray]:
    points = [(start_s, 0.0)]
    for k in range(count):
        points += [(start_s + (k + 0.5) * period_s, high), (start_s + (k + 1) * period_s, 0.0)]
    return _ramps(*points)


def _constant(value: float) -> Callable[[FloatArray], FloatArray]:
    return lambda t: np.full(t.size, value)


def _stop(name: str, speed: float, bar: float, duration: float, disc: float = 350.0, direction: int = 1) -> _Drive:
    return _Drive(name, duration, speed, disc, direction, pressure={ALL: _ramps((0.8, 0.0), (1.0, bar * BAR))})


def _coast(name: str, speed: float, duration: float, direction: int) -> _Drive:
    return _Drive(name, duration, speed, 320.0, direction)


def _motor_steps(name: str, speed: float, nm: float) -> _Drive:
    common = _steps((0.5, -nm), (1.5, nm), (2.5, 0.0), (5.0, -0.5 * nm), (5.5, 0.5 * nm), (6.0, 0.0))
    return _Drive(
        name, 7.0, speed,
        motor={ALL: common, FRONT: _steps((3.0, -nm), (3.6, nm), (4.2, 0.0)),
               REAR: _steps((4.2, -nm), (4.6, nm), (5.0, 0.0))},
    )  # fmt: skip


def _slalom(t: FloatArray) -> FloatArray:
    return np.where((t > 0.5) & (t < 7.5), 0.6 * np.sin(2.0 * np.pi * 0.5 * (t - 0.5)), 0.0)


def _full() -> list[_Drive]:
    """Minimal manoeuvre set of the effect catalogue, M1 to M10, in about three minutes."""
    return [
        _Drive("m01_standstill", 6.0, 0.0, 300.0),
        _coast("m02_coast_fast_out", 36.0, 16.0, 1),
        _coast("m02_coast_fast_back", 36.0, 16.0, -1),
        _coast("m02_coast_slow_out", 11.0, 12.0, 1),
        _coast("m02_coast_slow_back", 11.0, 12.0, -1),
        _motor_steps("m03_motor_36", 34.0, 220.0),
        _motor_steps("m03_motor_20", 20.0, 250.0),
        _motor_steps("m03_motor_5", 7.0, 150.0),
        _Drive(
            "m04_triangles", 18.0, 22.0, 340.0, pressure={ALL: lambda t: _triangles(0.5, 6.0, 2, 14 * BAR)(t)
            + _triangles(13.0, 1.0, 4, 14 * BAR)(t)}, hold=_constant(22.0),
        ),
        _stop("m05_stop_72_cold", 20.0, 30.0, 7.5, 293.15),
        _stop("m05_stop_130_firm", 36.0, 52.0, 7.5, 420.0),
        _stop("m05_stop_130_hot", 36.0, 30.0, 12.0, 590.0),
        _stop("m05_stop_72_hot", 20.0, 35.0, 6.0, 650.0, -1),
        _stop("m05_stop_40_soft", 11.0, 10.0, 10.0, 380.0, -1),
        _Drive(
            "m06_blend_steps", 9.0, 24.0, 350.0,
            pressure={ALL: _steps((0.5, 18 * BAR), (2.0, 5 * BAR), (3.5, 0.0), (5.0, 18 * BAR), (6.5, 9 * BAR))},
            motor={ALL: _steps((2.0, -170.0), (3.5, -250.0), (5.0, 0.0), (6.5, -125.0))},
        ),
        _Drive("m06_regen_stop", 5.0, 12.0, 350.0, motor={ALL: _steps((0.5, -550.0))}),
        _Drive("m07_slalom_stop", 13.0, 18.0, 350.0, steer=_slalom, hold=lambda t: np.where(t < 7.9, 18.0, np.nan),
               pressure={ALL: _ramps((8.0, 0.0), (8.3, 25 * BAR))}),
        _Drive("m08_motor_hard", 5.0, 18.0, 350.0,
               motor={ALL: _steps((0.5, -600.0), (1.6, 0.0), (2.2, 600.0), (3.2, -300.0), (4.2, 0.0))}),
        _Drive("m10_hold_pressure", 12.0, 0.0, 320.0,
               pressure={ALL: _steps((0.5, 10 * BAR), (4.5, 40 * BAR), (8.5, 5 * BAR))}),
    ]  # fmt: skip


def _stops() -> list[_Drive]:
    """Straight friction stops alone: mass, pad friction and drag are not isolable."""
    return [
        _stop("stop_72_a", 20.0, 30.0, 8.0),
        _stop("stop_72_b", 20.0, 30.0, 8.0, 380.0, -1),
        _stop("stop_100", 28.0, 30.0, 10.0, 400.0),
        _stop("stop_72_firm", 20.0, 45.0, 6.0, 400.0),
    ]


def _cold() -> list[_Drive]:
    """Cold gentle stops and coasting: nothing hot, nothing near the grip limit, no motor torque."""
    return [
        _coast("coast_out", 20.0, 15.0, 1),
        _coast("coast_back", 20.0, 15.0, -1),
        *(_stop(f"cold_stop_{k}", 15.0, 20.0, 8.0, 295.0, 1 - 2 * (k % 2)) for k in range(5)),
    ]


def _decide() -> list[_Drive]:
    """Regenerative pulses, coasting both ways and stops in reverse, beside what the stops alone leave tied."""
    return [
        *_stops(),
        _motor_steps("pulses_28", 28.0, 150.0),
        _motor_steps("pulses_20", 20.0, 250.0),
        _coast("coast_out", 36.0, 20.0, 1),
        _coast("coast_back", 36.0, 20.0, -1),
        _stop("stop_reverse", -9.0, 10.0, 10.0),
        _stop("stop_reverse_firm", -9.0, 30.0, 6.0),
    ]


SETS: dict[str, Callable[[], list[_Drive]]] = {"full": _full, "stops": _stops, "cold": _cold, "decide": _decide}
"""Manoeuvre sets by name."""


def manoeuvre_set(name: str, variant: int = 0) -> tuple[Manoeuvre, ...]:
    """All manoeuvres of a set, in order; a variant has other speeds, pressures and torques (0: as written)."""
    drives = [drive.made() for drive in SETS[name]()]
    if variant == 0:
        return tuple(drives)
    rng = np.random.default_rng(variant)
    return tuple(_varied(drive, rng) for drive in drives)


def _varied(drive: Manoeuvre, rng: np.random.Generator) -> Manoeuvre:
    speed, pressure, torque, steer = (float(rng.uniform(low, 1.06)) for low in (0.9, 0.8, 0.8, 0.8))
    return replace(
        drive, speed_mps=drive.speed_mps * speed, hold_mps=drive.hold_mps * speed,
        pressure_pa=drive.pressure_pa * pressure, motor_nm=drive.motor_nm * torque,
        steering_wheel_rad=drive.steering_wheel_rad * steer,
        disc_temperature_k=drive.disc_temperature_k + float(rng.uniform(-10.0, 10.0)),
    )  # fmt: skip

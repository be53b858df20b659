"""Which signals are brake pressures, motor torques and pedals, and what one of their units does to the car."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.log import WHEELS, Floats
from hil.diagnosis.data.trial.motion import STEP_S, filtered
from hil.diagnosis.data.units import OF_CHANNEL
from hil.diagnosis.draft.compare import Evidence, compared, half_width, left_out, without
from hil.diagnosis.draft.names import kinds, known_unit, quantity, wheel_of, words
from hil.diagnosis.draft.signals import Signal

_APPLIED = 0.1
"""Share of its highest value above which a pressure counts as applied."""
_LEAST_S, _SLOW_MPS = 2.0, 2.0
_NO_BRAKE = frozenset({
    "boost", "tyre", "tire", "tpms", "oil", "fuel", "manifold", "map", "intake", "ambient", "baro", "coolant", "clutch",
    "engine", "turbo", "exhaust", "hvac", "ac", "rail",
})  # fmt: skip
"""Words of pressures that brake nothing."""
_PER_BAR = (0.02, 0.30)
"""Deceleration per pressure, m/s2 per bar: 1 g at 33 to 500 bar. Road cars have 0.06 to 0.14; the AV-21, of half their
mass, 0.2 to 0.3."""
_SHOWS = 0.6


@dataclass(frozen=True, eq=False)
class Forced:
    """The motion that forces make: acceleration, m/s2, speed, m/s, and filtered sums of other forces; all (rows,)."""

    accel: Floats
    speed: Floats
    others: tuple[Floats, ...] = ()


@dataclass(frozen=True, eq=False)
class Brakes:
    """Pressures: one signal a wheel, or one for all; ``demand`` where its name is that of a demand.

    ``evidence`` compares the deceleration with the pressure while it is applied; ``per_unit`` is m/s2 for one of the
    signal's unit (mean over the wheels), with its interval; ``units`` are those in which that is a road car's.
    """

    signals: Mapping[str, Signal]
    demand: bool
    stated: str
    evidence: Evidence | None
    per_unit: float
    per_unit_ci: tuple[float, float]
    units: tuple[str, ...]
    others: tuple[str, ...] = ()


def four_of(
    signals: Mapping[str, Signal], kind: str, stem: str, demand: bool
) -> tuple[dict[str, Signal], list[Signal]]:
    """Signals of a kind by wheel, and those without a wheel; ``stem`` as of `names.quantity`."""
    by_wheel: dict[str, Signal] = {}
    single = []
    for name, one in signals.items():
        said, of = kinds(name, one.unit), quantity(one.unit)
        if of not in ("", stem) or not (kind in said or of == stem) or said & {"steer"}:
            continue
        if ("demand" in said) != demand or (kind == "pressure" and ("torque" in said or _NO_BRAKE & set(words(name)))):
            continue
        wheel = wheel_of(name)
        if wheel:
            by_wheel.setdefault(wheel, one)
        else:
            single.append(one)
    return by_wheel, single


def find_brakes(signals: Mapping[str, Signal], motion: Forced, demand: bool) -> Brakes | None:
    """The brake pressures, measured or demanded."""
    by_wheel, single = four_of(signals, "pressure", "pressure", demand)
    if len(by_wheel) == len(WHEELS):
        mean = np.asarray(np.mean([by_wheel[wheel].values for wheel in WHEELS], axis=0))
        return _brakes(by_wheel, mean, demand, motion, tuple(one.name for one in single))
    rated = []
    for one in [*single, *by_wheel.values()]:
        found = _brakes(dict.fromkeys(WHEELS, one), one.values, demand, motion, ())
        if "pressure" not in kinds(one.name, one.unit) and not (
            found.evidence and found.evidence.correlation < -_SHOWS
        ):
            continue  # its unit alone makes it no brake's
        rated.append((-abs(found.evidence.correlation) if found.evidence else 0.0, one.name, found))
    if not rated:
        return None
    rated.sort(key=lambda item: item[:2])
    best = rated[0][2]
    return Brakes(
        best.signals, demand, best.stated, best.evidence, best.per_unit, best.per_unit_ci, best.units,
        tuple(item[1] for item in rated[1:]),
    )  # fmt: skip


def _brakes(
    by_wheel: Mapping[str, Signal], mean: Floats, demand: bool, motion: Forced, others: tuple[str, ...]
) -> Brakes:
    stated = known_unit(next(iter(by_wheel.values())).unit)
    top = float(np.nanpercentile(np.abs(mean), 99.0))
    accel, speed = motion.accel, motion.speed
    seen, slope, interval = None, 0.0, (0.0, 0.0)
    smooth = filtered(mean)
    applied = (np.abs(smooth) > _APPLIED * top) & (np.abs(speed) > _SLOW_MPS) & np.isfinite(accel) & (top > 0.0)
    if applied.sum() * STEP_S >= _LEAST_S:
        wide = np.convolve(applied, np.ones(51), mode="same") > 0.5  # the way up and down shows the lag
        against = "the acceleration without what the motors make" if motion.others else "the acceleration"
        left = [without(np.where(wide, values, np.nan), motion.others) for values in (accel, smooth)]
        seen = compared(left[0], left[1], against, np.where(np.abs(speed) > _SLOW_MPS, 1.0, 0.0), 0.5)
        slope, interval = _per_unit(smooth, motion, wide)
    units: tuple[str, ...] = ()
    if seen is not None and abs(seen.correlation) > _SHOWS and slope != 0.0:
        per_bar = {unit: abs(slope) * 1e5 / factor for unit, factor in OF_CHANNEL["pressure"].items()}
        units = tuple(unit for unit, size in per_bar.items() if _PER_BAR[0] <= size <= _PER_BAR[1])
    return Brakes(by_wheel, demand, stated, seen, slope, interval, units, others)


def _per_unit(pressure: Floats, motion: "Forced", within: Floats) -> tuple[float, tuple[float, float]]:
    """Regression of the acceleration on pressure, motors, speed and a constant: m/s2 per unit with 95 %."""
    rows = np.asarray(within, bool) & (np.abs(motion.speed) > _SLOW_MPS)
    columns = [pressure, np.ones(len(pressure)), motion.speed, *motion.others]
    rows &= np.all(np.isfinite([motion.accel, *columns]), axis=0)
    x, y = np.column_stack([column[rows] for column in columns]), motion.accel[rows]

    def fitted(keep: Floats) -> float:
        return float(np.linalg.lstsq(x[keep], y[keep], rcond=None)[0][0])

    whole = fitted(np.ones(len(y), bool))
    half = half_width([fitted(keep) for keep in left_out(x[:, 0])])
    return whole, (whole - half, whole + half)


@dataclass(frozen=True, eq=False)
class Motors:
    """Motor torques by wheel; ``evidence`` compares their sum with the acceleration."""

    signals: Mapping[str, Signal]
    demand: bool
    stated: str
    evidence: Evidence | None


def find_motors(signals: Mapping[str, Signal], motion: Forced, moving: Floats, demand: bool) -> Motors | None:
    """Motor torques of four wheels, or of the wheels of one axle; ``motion.others`` are pressures, taken off."""
    by_wheel, _ = four_of(
        {n: s for n, s in signals.items() if "torque" in kinds(n, s.unit)}, "torque", "motor_torque", demand
    )
    axles = [axle for axle in "fr" if {f"{axle}l", f"{axle}r"} <= by_wheel.keys()]
    chosen = {wheel: by_wheel[wheel] for wheel in WHEELS if wheel[0] in axles}
    if not chosen:
        return None
    total = filtered(np.sum([one.values for one in chosen.values()], axis=0))
    against = "the acceleration without what the brakes make" if motion.others else "the acceleration"
    seen = compared(without(motion.accel, motion.others), without(total, motion.others), against, moving, 0.5)
    return Motors(chosen, demand, known_unit(next(iter(chosen.values())).unit), seen)


def motor_sums(signals: Mapping[str, Signal]) -> tuple[Floats, ...]:
    """The filtered sum of the motor torques (rows,), measured, else demanded; none without motors."""
    for demand in (False, True):
        by_wheel, _ = four_of(
            {n: s for n, s in signals.items() if "torque" in kinds(n, s.unit)}, "torque", "motor_torque", demand
        )
        if len(by_wheel) >= 2:
            return (filtered(np.sum([one.values for one in by_wheel.values()], axis=0)),)
    return ()


def pressure_sums(signals: Mapping[str, Signal]) -> tuple[Floats, ...]:
    """The filtered sum of the pressures (rows,), measured, else demanded; none without pressures."""
    for demand in (False, True):
        by_wheel, _ = four_of(signals, "pressure", "pressure", demand)
        if by_wheel:
            return (filtered(np.sum([one.values for one in by_wheel.values()], axis=0)),)
    return ()


def find_share(
    signals: Mapping[str, Signal], kind: str, accel: Floats, moving: Floats
) -> tuple[Signal, Evidence | None, tuple[str, ...]] | None:
    """A pedal, the throttle or the state of charge, by its name; that which goes best with the acceleration."""
    wanted = {"pedal": {"pedal"}, "throttle": {"throttle"}, "soc": {"soc"}}[kind]
    rated = []
    for name, one in signals.items():
        said, of = kinds(name, one.unit), quantity(one.unit)
        if not wanted & said or of not in ("", "pedal") or wheel_of(name) or "pressure" in said:
            continue
        if (kind == "pedal" and "throttle" in said) or (one.unit and known_unit(one.unit) not in ("", "%")):
            continue
        seen = compared(accel, filtered(one.values), "the acceleration", moving, 0.5) if kind != "soc" else None
        rated.append((-abs(seen.correlation) if seen else 0.0, name, one, seen))
    if not rated:
        return None
    rated.sort(key=lambda item: item[:2])
    return rated[0][2], rated[0][3], tuple(item[1] for item in rated[1:])


def share_unit(signal: Signal) -> str:
    """``%`` where the values go beyond one, else the share itself."""
    stated = known_unit(signal.unit)
    return stated or ("%" if float(np.nanmax(np.abs(signal.values))) > 1.5 else "")

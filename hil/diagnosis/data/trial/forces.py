"""Unit and sign of pressures and torques: wheel against wheel, measured against demanded, force against motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.data.grid import without_gaps
from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, Floats
from hil.diagnosis.data.trial.finding import Finding, sign_advice, unit_advice
from hil.diagnosis.data.trial.motion import Motion, filtered, spread

PRESSURE_UNITS = {"bar": 1e-5, "kPa": 1e-3, "MPa": 1e-6, "psi": 1.0 / 6894.757293168, "mbar": 1e-2}
TORQUE_UNITS = {"kN m": 1e-3}
"""Unit -> how many times too large values in it are, taken as SI."""
_WITHIN = 2.5
"""Factor within which a force counts as one in a unit: gains and masses are roughly known, kPa and psi differ by 7."""
_STRONG, _PARTIAL = 0.9, 0.7
"""Least correlation of two channels of one quantity, and of a force with what drag and the other force leave of the
motion: slopes and slip are in that."""
_LEAST_MPS2 = 0.3
_AXLES = 4.0
"""Factor within which pressures of two wheels, or a pressure and its demand, are alike."""
_GEARED = (3.0, 20.0)


@dataclass(frozen=True)
class Force:
    """How a force goes with the motion: ``factor`` on what the vehicle set makes of it, and its partial correlation."""

    factor: float
    correlation: float


def forces(motion: Motion) -> list[Finding]:
    """The first contradictions of pressures and of torques."""
    found = []
    for measured, demanded, units in (
        (PRESSURE, PRESSURE_DEMAND, PRESSURE_UNITS), (MOTOR_TORQUE, MOTOR_DEMAND, TORQUE_UNITS),
    ):  # fmt: skip
        found += (
            _alike(motion, measured, units)
            or _alike(motion, demanded, units)
            or _demand(motion, measured, demanded, units)
        )
    return found or _against_motion(motion)


def _size(values: Floats) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, 99.0)) if len(known) > 100 else 0.0


def _correlated(x: Floats, y: Floats) -> float:
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < 100 or min(np.std(x[known]), np.std(y[known])) <= 0.0:
        return 0.0
    return float(np.corrcoef(x[known], y[known])[0, 1])


def _unit(ratio: float, units: Mapping[str, float], within: float) -> str | None:
    """The unit whose factor is nearest to a ratio, within a factor; None where none is."""
    nearest = min(units, key=lambda unit: abs(np.log(max(ratio, 1e-30) / units[unit])))
    return nearest if abs(np.log(max(ratio, 1e-30) / units[nearest])) < np.log(within) else None


def _alike(motion: Motion, names: Sequence[str], units: Mapping[str, float]) -> list[Finding]:
    """Wheels in a smaller unit than the largest one."""
    sizes = {name: _size(motion.raw[name]) for name in names if name in motion.raw}
    if len(sizes) < 2:
        return []
    largest = max(sizes, key=lambda name: sizes[name])
    by_unit: dict[str, list[str]] = {}
    for name, size in sizes.items():
        unit = _unit(size / sizes[largest], units, _AXLES) if sizes[largest] > 0.0 and size > 0.0 else None
        if unit is not None and _correlated(motion.raw[largest], motion.raw[name]) > _STRONG:
            by_unit.setdefault(unit, []).append(name)
    return [
        Finding(
            tuple(odd), f"{', '.join(odd)} read {sizes[odd[0]] / sizes[largest]:.3g} times {largest}",
            unit_advice(tuple(odd), unit),
        )
        for unit, odd in by_unit.items()
    ]  # fmt: skip


def _demand(
    motion: Motion, measured: Sequence[str], demanded: Sequence[str], units: Mapping[str, float]
) -> list[Finding]:
    """Demands beside what they demand."""
    raw = motion.raw
    if not all(name in raw for name in (*measured, *demanded)):
        return []
    got, wish = np.sum([raw[name] for name in measured], axis=0), np.sum([raw[name] for name in demanded], axis=0)
    correlation = _correlated(wish, got)
    if abs(correlation) < 0.8 or not _size(wish) or not _size(got):
        return []
    ratio = _size(wish) / _size(got)
    for names, share, other in ((demanded, ratio, measured), (measured, 1.0 / ratio, demanded)):
        unit = _unit(share, units, _AXLES)
        if unit is not None:
            what = f"{names[0]} and the other wheels' are {share:.3g} times {other[0]} and so on"
            return [Finding(tuple(names), what, unit_advice(tuple(names), unit))]
    if correlation < 0.0:
        what = f"{demanded[0]} and {measured[0]} have opposite signs (correlation {correlation:.2f}; all wheels)"
        advice = "one of both is turned: braking torques are negative, pressures positive; sign = -1 in the --map"
        return [Finding((*measured, *demanded), what, advice)]
    return []


def _names(motion: Motion, *groups: Sequence[str]) -> tuple[str, ...]:
    """The first group that all wheels have."""
    return next((tuple(group) for group in groups if all(name in motion.raw for name in group)), ())


def _accelerations(motion: Motion) -> dict[tuple[str, ...], Floats]:
    """Channels -> acceleration, m/s2, that the vehicle set makes of brakes and motors."""
    car = motion.car
    per_nm = 1.0 / (car.radius_m * car.mass_kg)
    found: dict[tuple[str, ...], Floats] = {}
    if brakes := _names(motion, PRESSURE, PRESSURE_DEMAND):
        torque = -np.sum([g * motion.raw[name] for g, name in zip(car.brake_gain_nm_pa, brakes, strict=True)], axis=0)
        found[brakes] = filtered(torque * per_nm)
    if motors := _names(motion, MOTOR_TORQUE, MOTOR_DEMAND):
        found[motors] = filtered(np.sum([motion.raw[name] for name in motors], axis=0) * per_nm)
    return found


def force_parts(motion: Motion) -> dict[str, tuple[Floats, Floats]]:
    """``pressure`` and ``motor``, as measured -> the acceleration without what the other makes, and what it makes."""
    reference = motion.along.get("wheels", motion.along.get("ground"))
    parts = {names: part for names, part in _accelerations(motion).items() if spread(part) > 0.0}
    found: dict[str, tuple[Floats, Floats]] = {}
    if reference is None:
        return found
    for names, part in parts.items():
        kind = "pressure" if names == PRESSURE else "motor" if names == MOTOR_TORQUE else ""
        if kind:
            others = np.sum([other for key, other in parts.items() if key != names], axis=0)
            rest = np.where(motion.fast, reference - others, np.nan)  # brakes hold a car that stands
            share = spread(part) / max(spread(rest), 1e-9)
            if share > 0.3:
                found[kind] = (rest, part)
    return found


def force_fit(motion: Motion) -> dict[tuple[str, ...], Force]:
    """Channels -> how their force goes with the acceleration: regression with drag and rolling resistance."""
    reference = motion.along.get("wheels", motion.along.get("ground"))
    if reference is None:
        return {}
    parts = {names: part for names, part in _accelerations(motion).items() if spread(part) > 0.0}
    fast = motion.fast & np.isfinite(reference) & np.all([np.isfinite(part) for part in parts.values()], axis=0)
    if not parts or fast.sum() < 200 or float(np.std(reference[fast])) < _LEAST_MPS2:
        return {}
    speed = without_gaps(motion.speed_mps)
    columns = [part[fast] for part in parts.values()] + [np.ones(int(fast.sum())), (speed * np.abs(speed))[fast]]
    found = {}
    for k, names in enumerate(parts):
        others = np.column_stack([column for j, column in enumerate(columns) if j != k])
        y, x = (
            value - others @ np.linalg.lstsq(others, value, rcond=None)[0] for value in (reference[fast], columns[k])
        )
        if np.std(x) > 1e-9 * np.std(columns[k]) and np.std(y) > 0.0:
            found[names] = Force(float(x @ y / (x @ x)), float(x @ y / np.sqrt((x @ x) * (y @ y))))
    return found


def _against_motion(motion: Motion) -> list[Finding]:
    found = []
    for names, force in force_fit(motion).items():
        if abs(force.correlation) < _PARTIAL:
            continue
        brakes = names[0].startswith("pressure")
        unit = _unit(1.0 / abs(force.factor), PRESSURE_UNITS if brakes else TORQUE_UNITS, _WITHIN)
        source = "brake gains, mass and radius" if brakes else "mass and radius"
        kind, does = ("pressures", "brakes") if brakes else ("torques", "gains and loses speed")
        what = (
            f"the car {does} {abs(force.factor):.3g} times as much as its {kind} ({names[0]} and the other wheels') "
            f"make of it with the stated {source} (correlation {abs(force.correlation):.2f})"
        )
        if unit is not None:
            found.append(Finding(names, what, unit_advice(names, unit)))
        elif force.factor < 0.0 and abs(np.log(-force.factor)) < np.log(2.0):
            positive = "pressures are positive" if brakes else "a torque that drives the car is positive"
            what = f"{names[0]} and the other wheels' act against the motion (factor {force.factor:.2f})"
            found.append(Finding(names, what, sign_advice(names, positive)))
        elif not brakes and _GEARED[0] < force.factor < _GEARED[1]:
            advice = "torques are those at the wheels: behind a gear give its ratio as scale in the --map"
            found.append(Finding(names, what, advice, certain=False))
    return found

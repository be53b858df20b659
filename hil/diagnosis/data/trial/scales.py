"""Unit, scale and sign of wheel speeds, ground speed and longitudinal acceleration, each by the others."""

import numpy as np

from hil.diagnosis.data.log import WHEEL_SPEED, Floats
from hil.diagnosis.data.trial.agreement import Agreement, agreement, near
from hil.diagnosis.data.trial.finding import Finding, sign_advice, unit_advice
from hil.diagnosis.data.trial.motion import STEP_S, Motion, spread
from hil.diagnosis.data.units import DEG, RPM

G = 9.80665
GROUND = {"km/h": 3.6, "mph": 1.0 / 0.44704, "knots": 1.0 / 0.514444}
"""Unit -> how many times too large a ground speed in it is, taken as m/s."""
TURNING = {"rpm": 1.0 / RPM, "deg/s": 1.0 / DEG, "rev/s": 0.5 / np.pi}
ROAD = {"m/s": 1.0, "km/h": 3.6, "mph": 1.0 / 0.44704}
"""Wheel speeds as speeds of the road: times the radius as well."""
ACCELERATION = {"g": 1.0 / G, "mg": 1e3 / G, "cm/s2": 100.0}
_EXACT, _SHAKY = 0.03, 0.08
"""How far a ratio of speeds, and of accelerations, may lie from a unit's factor: a radius is known to 1 to 3 %, an
acceleration has slope and dive in it."""
_SPREAD = 0.05
"""Largest relative spread of a ratio of speeds."""
STRONG = 0.9
"""Least size of a correlation from which on a factor counts."""
_NEAR_S = 0.3
_LEAST_MPS2 = 0.3
"""Least standard deviation of a stretch's acceleration that shows a factor."""
_MOST_MPS2 = 15.0
"""Longitudinal acceleration that no road car reaches for long, m/s2: tyres grip with 1.2 times the load."""


def wheel_against_wheel(motion: Motion) -> list[Finding]:
    """Wheels in another unit than the others."""
    names = [name for name in WHEEL_SPEED if name in motion.raw]
    sizes = {name: size for name in names if (size := _size(motion.raw[name])) > 0.0}
    if len(sizes) < 2 or max(sizes.values()) < 2.0 * min(sizes.values()):
        return []
    units = _wheel_units(motion.car.radius_m)
    for unit, factor in units.items():
        for reference in sizes.values():
            odd = tuple(name for name, size in sizes.items() if near(size / reference, factor, _EXACT))
            like = tuple(name for name, size in sizes.items() if near(size, reference, _EXACT))
            if odd and like and len(odd) + len(like) == len(sizes) and not near(factor, 1.0, 0.3):
                what = f"{', '.join(odd)} read {sizes[odd[0]] / reference:.4g} times {', '.join(like)}"
                return [Finding(odd, what, _wheel_advice(odd, unit, motion.car.radius_m))]
    return []


def _wheel_units(radius_m: float) -> dict[str, float]:
    """Unit -> how many times too large wheel speeds in it are, taken as rad/s."""
    return TURNING | {unit: factor * radius_m for unit, factor in ROAD.items()}


def _wheel_advice(channels: tuple[str, ...], unit: str, radius_m: float) -> str:
    if unit in TURNING:
        return unit_advice(channels, unit)
    return (
        f"a speed of the road in {unit}? Turn it into rad/s in the --map, for each wheel: [{channels[0]}] "
        f'signal = "{channels[0]}", unit = "{unit}", scale = {1.0 / radius_m:.5g} (one over the rolling radius)'
    )


def _size(values: Floats) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, 90.0)) if len(known) > 100 else 0.0


def speed_against_speed(motion: Motion) -> list[Finding]:
    """Wheels against the ground speed: the ratio of the speeds themselves, which no lag and no slope touches."""
    wheels, ground = motion.wheels_mps, motion.ground_mps
    if not (len(wheels) and len(ground)):
        return []
    both = motion.fast & np.isfinite(ground) & (np.abs(ground) > 0.0)
    if both.sum() < 100:
        return []
    ratios = ground[both] / wheels[both]
    ratio = float(np.median(ratios))
    spread = 1.48 * float(np.median(np.abs(ratios - ratio))) / max(abs(ratio), 1e-9)
    if spread > _SPREAD:
        return []
    got = f"speed_mps is {abs(ratio):.4g} times the wheels' (median over {both.sum() * STEP_S:.3g} s)"
    found = []
    if not near(abs(ratio), 1.0, 0.06):
        for unit, factor in GROUND.items():
            if near(abs(ratio), factor, _EXACT) and _confirmed(motion, "ground", "wheels"):
                found.append(Finding(("speed_mps",), got, unit_advice(("speed_mps",), unit)))
        names = tuple(name for name in WHEEL_SPEED if name in motion.raw)
        for unit, factor in _wheel_units(motion.car.radius_m).items():
            share = 0.5 * _EXACT if near(factor, 1.0, 0.25) else _EXACT
            if near(abs(ratio), 1.0 / factor, share) and _confirmed(motion, "wheels", "ground"):
                found.append(Finding(names, got, _wheel_advice(names, unit, motion.car.radius_m)))
    if ratio < 0.0 and not found:
        found.append(Finding(("speed_mps",), f"{got}, with the other sign", _direction_advice()))
    return found[:1] if len(found) < 2 else [_either(found)]


def _direction_advice() -> str:
    return "wheel speeds and speed_mps have one sign, positive forward: turn one with sign = -1 in the --map"


def _either(found: list[Finding]) -> Finding:
    """Two readings that fit alike as one finding."""
    channels = tuple(dict.fromkeys(name for one in found for name in one.channels))
    return Finding(channels, found[0].what, "; or ".join(one.advice for one in found))


def _confirmed(motion: Motion, wrong: str, right: str) -> bool:
    """Whether the accelerometer does not contradict that the one of both speeds is wrong; true without its word."""
    if "ax" not in motion.along:
        return True
    by = {name: _along(motion, name) for name in (wrong, right)}
    if min(abs(one.correlation) for one in by.values()) < STRONG:
        return True
    off = {name: abs(float(np.log(abs(one.factor)))) for name, one in by.items()}
    return off[right] < off[wrong]


def _along(motion: Motion, reference: str) -> Agreement:
    """The accelerometer against the derivative of a speed, ``wheels`` or ``ground``, where that is excited."""
    accel = motion.along[reference]
    inside = np.where(motion.fast, 1.0, 0.0)
    return agreement(accel, motion.along["ax"], _NEAR_S, inside)


def accelerometer(motion: Motion) -> list[Finding]:
    """The accelerometer against the derivative of the speed."""
    reference = "wheels" if "wheels" in motion.along else "ground"
    if "ax" not in motion.along or reference not in motion.along:
        return []
    seen = _along(motion, reference)
    accel = motion.along[reference][motion.fast]
    if abs(seen.correlation) < STRONG or max(1.0, abs(seen.factor)) * spread(accel) < _LEAST_MPS2:
        return []
    size, source = abs(seen.factor), "the wheels'" if reference == "wheels" else "speed_mps'"
    got = (
        f"ax_mps2 is {seen.factor:.4g} times {source} acceleration (correlation {seen.correlation:.2f} over "
        f"{seen.samples * STEP_S:.3g} s)"
    )
    turned = seen.factor < 0.0
    wrong = {("ax_mps2", unit): factor for unit, factor in ACCELERATION.items()}
    if reference == "ground":
        wrong |= {("speed_mps", unit): 1.0 / factor for unit, factor in GROUND.items()}
    elif "ground" not in motion.along:
        wrong |= {("wheel", unit): 1.0 / factor for unit, factor in TURNING.items()}
    fitting = [key for key, factor in wrong.items() if near(size, factor, _SHAKY)]
    hard = float(np.nanpercentile(np.abs(accel), 99.0)) > _MOST_MPS2
    if len(fitting) > 1:  # rpm and g differ by 3 %: no car brakes as hard as wheels in rpm would say
        fitting = [key for key in fitting if (key[0] == "wheel") == hard]
    sign = "; and its sign is turned (ax_mps2 is negative in braking): sign = -1 in the --map" if turned else ""
    for channel, unit in fitting:
        names = tuple(name for name in WHEEL_SPEED if name in motion.raw) if channel == "wheel" else (channel,)
        advice = unit_advice(names, unit) + sign
        return [Finding(names, got, advice, names_itself=channel == "ax_mps2")]
    if turned and near(size, 1.0, 0.3):
        advice = sign_advice(("ax_mps2",), "ax_mps2 is negative in braking")
        return [Finding(("ax_mps2",), got, advice, names_itself=True)]
    return []


def impossible_motion(motion: Motion) -> list[Finding]:
    """A speed that changes as no car's does, where nothing else shows its unit."""
    reference = "wheels" if "wheels" in motion.along else "ground"
    if reference not in motion.along:
        return []
    accel = np.abs(motion.along[reference][motion.fast])
    accel = accel[np.isfinite(accel)]
    if len(accel) < 100 or (most := float(np.percentile(accel, 95.0))) < 2.0 * _MOST_MPS2:
        return []
    names = ("speed_mps",) if reference == "ground" else tuple(name for name in WHEEL_SPEED if name in motion.raw)
    what = (
        f"{', '.join(names)} change by {most:.3g} m/s2 for a twentieth of the time; a road car reaches {_MOST_MPS2:g}"
    )
    units = "km/h" if reference == "ground" else "rpm"
    return [Finding(names, what, f"is t_s in s, are the speeds in SI? {unit_advice(names, units)}")]


def all_scales(motion: Motion) -> list[Finding]:
    """The first contradiction along the car: what follows from it is not looked at."""
    for rule in (wheel_against_wheel, speed_against_speed, accelerometer, impossible_motion):
        found = rule(motion)
        if found:
            return found
    return []

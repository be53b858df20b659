"""Unit and sign of yaw rate, lateral acceleration and steering: four channels show how fast the car turns."""

import numpy as np

from hil.diagnosis.data.log import WHEEL_SPEED, Floats
from hil.diagnosis.data.trial.agreement import Agreement, agreement, near
from hil.diagnosis.data.trial.finding import Finding, sign_advice, unit_advice
from hil.diagnosis.data.trial.motion import STEP_S, Motion, filtered, spread
from hil.diagnosis.data.trial.scales import ACCELERATION, STRONG
from hil.diagnosis.data.units import DEG

_NEAR_S = 0.4
_LEAST_RAD_S = 0.02
"""Least standard deviation of the yaw rate that shows a sign: 1.1 deg/s."""
_LEAST_MPS = 4.0
_SHARE, _STEERING = 0.2, 0.6
"""How far a factor may lie from a unit's: track widths are known to some per cent; what a steering angle turns the car
by depends on speed (understeer) and on a ratio that hardly a set states."""
_POSITIVE = "turning to the left is positive"
_CHANNEL = {"yaw": ("yaw_rate_rad_s",), "ay": ("ay_mps2",), "steer": ("steer_rad",), "wheels": WHEEL_SPEED}
_SHOWN = {
    "yaw": "yaw_rate_rad_s", "ay": "ay_mps2 over the speed", "steer": "steer_rad",
    "wheels": "the difference of right and left wheel speeds over the track",
}  # fmt: skip
_UNITS = {
    "yaw": ({"deg/s": 1.0 / DEG, "mrad/s": 1e3}, _SHARE), "ay": (ACCELERATION, _SHARE),
    "steer": ({"deg": 1.0 / DEG}, _STEERING),
}  # fmt: skip


def turning(motion: Motion) -> dict[str, Floats]:
    """Source -> (rows,) yaw rate that it shows, rad/s, all through one filter; only where the car drives."""
    speed = motion.speed_mps
    if not len(speed):
        return {}
    drives = np.abs(speed) > _LEAST_MPS
    safe = np.where(drives, speed, np.nan)
    raw, car = motion.raw, motion.car
    found: dict[str, Floats] = {}
    if all(name in raw for name in WHEEL_SPEED):
        fl, fr, rl, rr = (raw[name] for name in WHEEL_SPEED)
        found["wheels"] = 0.5 * (fr - fl + rr - rl) * car.radius_m / car.track_m
    if "yaw_rate_rad_s" in raw:
        found["yaw"] = raw["yaw_rate_rad_s"]
    if "ay_mps2" in raw:
        found["ay"] = raw["ay_mps2"] / safe
    if "steer_rad" in raw:
        found["steer"] = raw["steer_rad"] * safe / car.steering_m
    return {name: filtered(np.where(drives, values, np.nan)) for name, values in found.items()}


def lateral(motion: Motion) -> list[Finding]:
    """Each source against the others: a unit by its factor, a sign by the majority."""
    shown = turning(motion)
    names = tuple(shown)
    seen: dict[tuple[str, str], Agreement] = {}
    for k, x in enumerate(names):
        for y in names[k + 1 :]:
            one = agreement(shown[x], shown[y], _NEAR_S)
            if abs(one.correlation) > STRONG and one.samples > 0:
                seen[x, y] = one
                inverse = 1.0 / one.factor
                seen[y, x] = Agreement(one.correlation, inverse, -one.lag_s, one.samples)
    if not seen or not _excited(shown, seen):
        return []
    return _units(seen) or _signs(seen)


def _excited(shown: dict[str, Floats], seen: dict[tuple[str, str], Agreement]) -> bool:
    """Whether the car turns, by two sources at least."""
    sizes = sorted(spread(shown[name]) for name in {name for pair in seen for name in pair})
    return sizes[-2] > _LEAST_RAD_S


def _units(seen: dict[tuple[str, str], Agreement]) -> list[Finding]:
    """A source that is off by the factor of a unit from all others that go with it."""
    for name, (units, share) in _UNITS.items():
        others = {x: one for (x, y), one in seen.items() if y == name and x != "steer"}
        for unit, factor in units.items():
            if others and all(near(abs(one.factor), factor, share) for one in others.values()):
                if _also_another(seen, name, set(others)):
                    continue
                other, one = next(iter(others.items()))
                sign = f"; and its sign is turned ({_POSITIVE}): sign = -1 in the --map" if one.factor < 0.0 else ""
                advice = unit_advice(_CHANNEL[name], unit) + sign
                return [Finding(_CHANNEL[name], _got(name, other, one), advice, names_itself=True)]
    return []


def _also_another(seen: dict[tuple[str, str], Agreement], name: str, others: set[str]) -> bool:
    """Whether the one other source may be in another unit just as well."""
    if len(others) > 1:
        return False
    (other,) = others
    if other not in _UNITS:
        return False
    units, share = _UNITS[other]
    return any(near(abs(seen[name, other].factor), factor, share) for factor in units.values())


def _signs(seen: dict[tuple[str, str], Agreement]) -> list[Finding]:
    """A source whose sign all others contradict; where two stand alone, both."""
    names = {name for pair in seen for name in pair}
    against = {name: [x for (x, y), one in seen.items() if y == name and one.correlation < 0.0] for name in names}
    with_it = {name: [x for (x, y), one in seen.items() if y == name and one.correlation > 0.0] for name in names}
    worst = max(sorted(names), key=lambda name: len(against[name]) - len(with_it[name]))
    if not against[worst]:
        return []
    other = against[worst][0]
    got = _got(worst, other, seen[other, worst])
    if len(against[worst]) > 1 and not with_it[worst]:
        return [Finding(_CHANNEL[worst], got, _sign_advice(worst), names_itself=worst != "steer")]
    both = (*_CHANNEL[worst], *_CHANNEL[other])
    if len(names) == 2:
        advice = f"nothing else shows which of both is turned; {_sign_advice(worst)}; or {_sign_advice(other)}"
        return [Finding(both, got, advice, names_itself=True)]
    return []


def _sign_advice(name: str) -> str:
    if name == "wheels":
        return "are the wheels of left and right exchanged? Exchange their signals in the --map"
    return sign_advice(_CHANNEL[name], _POSITIVE)


def _got(name: str, other: str, one: Agreement) -> str:
    return (
        f"{_SHOWN[name]} is {one.factor:.4g} times the yaw rate by {_SHOWN[other]} (correlation {one.correlation:.2f} "
        f"over {one.samples * STEP_S:.3g} s)"
    )

"""Guesses of the channels along the car: speeds, their units together, the accelerometer, and the rolling radius."""

from dataclasses import replace

import numpy as np

from hil.diagnosis.data.log import WHEEL_SPEED, WHEELS, Floats
from hil.diagnosis.data.trial.motion import STEP_S, slope
from hil.diagnosis.data.units import OF_CHANNEL
from hil.diagnosis.draft.compare import Evidence, compared
from hil.diagnosis.draft.guess import Guess, SetNumber
from hil.diagnosis.draft.names import known_unit
from hil.diagnosis.draft.signals import Signal
from hil.diagnosis.draft.speeds import Speeds
from hil.diagnosis.draft.unit_choice import TELLING, Scales, UnitChoice

_REST_S, _ROCKING = 0.3, 25
"""Shortest standstill that is read, s, and the rows in which a car rocks as it comes to rest: half a second."""
_FELT_MPS2 = 0.1
"""Reading at rest that is a slope of one per cent, or a zero as large."""
_WRONG = 0.12
"""Share by which an accelerometer may differ from the wheels: dive and squat, slip, its own scale."""


def filtered_accel(speeds: Speeds, units: UnitChoice) -> Floats:
    """(rows,) acceleration of the car by its speed, m/s2."""
    return speeds.derivative * units.wheel_to_mps


def measured_scales(speeds: Speeds) -> Scales:
    """Ratios of the speeds and of accelerometers to their derivative, in the units of the signals."""
    wheels, ground = speeds.wheels, speeds.ground[0] if speeds.ground else None
    moving = speeds.moving > 0.0
    known = np.abs(speeds.reference[moving & np.isfinite(speeds.reference)])
    hardest = np.abs(speeds.derivative[moving & np.isfinite(speeds.derivative)])
    ratio = None
    if wheels and ground is not None:
        ratio = abs(_ratio(ground, speeds).ratio)
    return Scales(
        known_unit(next(iter(wheels.values())).unit) if wheels else None,
        None if ground is None else known_unit(ground.unit),
        tuple(known_unit(one.unit) for one, _ in speeds.telling), ratio,
        tuple(abs(seen.ratio) for _, seen in speeds.telling),
        float(np.percentile(known, 99.0)) if len(known) else 0.0,
        float(np.percentile(hardest, 99.0)) if len(hardest) else 0.0,
    )  # fmt: skip


def _ratio(ground: Signal, speeds: Speeds) -> Evidence:
    """The ground speed beside the reference: the ratio of the speeds themselves, lag by their course."""
    both = (speeds.moving > 0.0) & np.isfinite(ground.values) & np.isfinite(speeds.reference)
    ratios = ground.values[both] / speeds.reference[both]
    seen = compared(speeds.derivative, slope(ground.values), "", speeds.moving, 1.0)
    blocks = [float(np.median(part)) for part in np.array_split(ratios, 10) if len(part)]
    middle, half = float(np.median(ratios)), 2.262 * float(np.std(blocks)) / 3.0
    correlation = float(np.corrcoef(ground.values[both], speeds.reference[both])[0, 1])
    lag = 0.0 if seen is None else seen.lag_s
    against = f"the speed by {speeds.source}"
    return Evidence(correlation, middle, middle - half, middle + half, lag, against, float(both.sum()) * STEP_S)


def _open(choices: list[UnitChoice], stated: str) -> tuple[str, ...]:
    """What other units the measurements allow, and what they say to the stated ones."""
    best = choices[0]
    found = []
    allowed = [one for one in choices[1:] if one.cost < best.cost + TELLING and one.wheel != best.wheel]
    if allowed:
        others = "; or ".join(dict.fromkeys(one.text for one in allowed[:3]))
        found.append(f"the data allow as well: {others}")
    if stated and best.wheel not in (None, stated):
        found.append(f"the unit stated is {stated}; the measurements contradict it, unless all of them are off alike")
    return tuple(found)


def speed_guesses(speeds: Speeds, units: UnitChoice, choices: list[UnitChoice], seen: Scales) -> list[Guess]:
    """Wheel speeds and ground speed in the units ``units``, the best of the ``choices``."""
    guesses = []
    stated = seen.wheel or ""
    unit = units.wheel or ""
    notes = [speeds.front_rear] if speeds.front_rear else []
    notes += [f"{units.text} agree with each other"] if seen.per_derivative or seen.ground_per_wheel else []
    unknown = list(_open(choices, stated))
    check = [] if speeds.by_name else ["which wheel is which: names and file order say no more than that"]
    if not seen.per_derivative and not seen.ground_per_wheel and not stated:
        unknown.append("nothing else shows the unit: only the range of the values")
    basis = (
        "name" if speeds.by_name else "data: four signals alike",
        "unit stated" if unit == stated else "unit guessed",
    )
    if not speeds.by_name:
        unknown.append("front and rear, and left and right, unless a channel that turns shows them")
    for k, (wheel, channel) in enumerate(zip(WHEELS, WHEEL_SPEED, strict=True)):
        if wheel not in speeds.wheels:
            continue
        signal = speeds.wheels[wheel]
        evidence = compared(speeds.reference, signal.values, speeds.source, speeds.moving, 0.0)
        guesses.append(
            Guess(
                channel, signal.name, unit, basis=basis, evidence=evidence, measured=tuple(notes) if not k else (),
                unknown=tuple(unknown) if not k else (), check=tuple(check) if not k else (),
            )
        )  # fmt: skip
    if speeds.ground:
        ground = speeds.ground[0]
        with_wheels = _ratio(ground, speeds) if speeds.wheels else None
        stated_ground = known_unit(ground.unit)
        more: tuple[str, ...] = ()
        if with_wheels is not None and with_wheels.high - with_wheels.low < 2e-4 * abs(with_wheels.ratio):
            more = ("whether it is measured over ground or computed from the wheels: it follows them exactly",)
        guesses.append(
            Guess(
                "speed_mps", ground.name, units.ground or "", 1 if with_wheels is None or with_wheels.ratio > 0 else -1,
                basis=("name", "unit stated" if stated_ground == units.ground else "unit guessed"),
                evidence=with_wheels, unknown=more, others=tuple(one.name for one in speeds.ground[1:]),
            )
        )  # fmt: skip
    return guesses


def ax_guess(speeds: Speeds, units: UnitChoice) -> list[Guess]:
    """The longitudinal acceleration: sign, unit, what it reads at rest, and the other accelerometers beside it."""
    if not speeds.accelerometers:
        return []
    signal, seen = speeds.accelerometers[0]
    by_signal = dict(zip((one.name for one, _ in speeds.telling), units.accelerations, strict=True))
    unit = by_signal.get(signal.name) or _unit_alone(signal, seen, units)
    factor = OF_CHANNEL["ax"][unit]
    ratio = _scaled(seen, factor / units.wheel_to_mps)
    sign = 1 if seen.ratio > 0.0 else -1
    still = [sign * factor * value for value in _at_rest(signal, speeds)]
    notes, unknown, check = [], [], []
    if still:
        listed = ", ".join(f"{value:.2f}" for value in still[:6])
        notes.append(f"reads {listed} m/s2 at {'one standstill' if len(still) == 1 else f'{len(still)} standstills'}")
        if len(still) > 1 and max(still) - min(still) > _FELT_MPS2:
            notes.append("that differs from place to place: gravity is in it, it feels the slope")
        elif max(map(abs, still)) > _FELT_MPS2:
            unknown.append("whether that is the sensor's zero or the slope it stands on")
        else:
            unknown.append("whether gravity is in it: it may be computed, or have stood on level ground")
    else:
        unknown.append("whether gravity is in it, and its zero: the car never stands")
    more = abs(ratio.ratio) - 1.0
    if not -_WRONG < more < _WRONG:
        unknown.append(
            f"why it reads {100.0 * more:+.0f} % beside the wheels: a scale, a unit, a filter, or the speed's scale"
        )
    elif abs(more) > 0.02:
        notes.append(f"{100.0 * more:+.0f} % beside the wheels: dive and squat (1 to 7 %), its scale, or the speed's")
    for one, other in speeds.accelerometers[1:3]:
        own = by_signal.get(one.name) or _unit_alone(one, other, units)
        notes.append(f"{one.name} in {own}: {_scaled(other, OF_CHANNEL['ax'][own] / units.wheel_to_mps).text}")
    check.append("braking must read negative")
    stated = known_unit(signal.unit)
    return [
        Guess(
            "ax_mps2", signal.name, unit, sign, basis=("data", "unit stated" if stated == unit else "unit guessed"),
            evidence=ratio, measured=tuple(notes), unknown=tuple(unknown), check=tuple(check),
            others=tuple(one.name for one, _ in speeds.accelerometers[1:]),
        )
    ]  # fmt: skip


def _scaled(seen: Evidence, factor: float) -> Evidence:
    return replace(seen, ratio=seen.ratio * factor, low=seen.low * factor, high=seen.high * factor)


def _unit_alone(signal: Signal, seen: Evidence, units: UnitChoice) -> str:
    """Unit of an accelerometer that says nothing of the speeds' units: as stated, else nearest to the wheels."""
    stated = known_unit(signal.unit)
    if stated in OF_CHANNEL["ax"]:
        return stated
    off = {
        unit: abs(np.log(max(abs(seen.ratio), 1e-12) * OF_CHANNEL["ax"][unit] / units.wheel_to_mps))
        for unit in ("m/s2", "g")
    }
    return min(off, key=lambda unit: off[unit])


def _at_rest(signal: Signal, speeds: Speeds) -> list[float]:
    """Mean readings at each standstill."""
    speed = np.abs(speeds.reference)
    top = float(np.nanpercentile(speed, 95.0))
    still = np.nan_to_num(speed, nan=np.inf) < 1e-3 * top
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(int), [0]))))
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        inside = signal.values[begin + (_ROCKING if begin else 0) : end]
        inside = inside[np.isfinite(inside)]
        if len(inside) * STEP_S >= _REST_S:
            found.append(float(np.mean(inside)))
    return found


def rolling_radius(speeds: Speeds, units: UnitChoice, seen: Scales) -> list[SetNumber]:
    """The rolling radius, where the wheels turn in one unit and a ground speed has another."""
    if units.wheel is None:
        return [SetNumber("rolling_radius_m", "no wheel speeds: nothing shows it")]
    if units.wheel in OF_CHANNEL["speed"]:
        return [
            SetNumber(
                "rolling_radius_m",
                "not to be seen: the wheel speeds are speeds of the road already; the sheet's radius makes them rad/s",
            )
        ]  # fmt: skip
    turning = OF_CHANNEL["wheel_speed"][units.wheel]
    if speeds.ground and units.ground is not None:
        ratio = _ratio(speeds.ground[0], speeds)
        factor = OF_CHANNEL["speed"][units.ground] / turning
        value, half = abs(ratio.ratio) * factor, 0.5 * (ratio.high - ratio.low) * factor
        text = (
            f"speed_mps per wheel speed: {value:.4f} m +- {half:.4f}, if the speed is right; a speed that is computed "
            "from the wheels has its maker's radius in it"
        )
        return [SetNumber("rolling_radius_m", text, round(value, 4), max(round(half, 4), round(0.01 * value, 4)))]
    if seen.per_derivative:
        sizes = [
            ratio * OF_CHANNEL["ax"][unit] / turning
            for ratio, unit in zip(seen.per_derivative, units.accelerations, strict=True)
        ]
        listed = " and ".join(f"{one:.3f} m" for one in sizes)
        text = f"acceleration per derivative of the wheel speed: {listed}; dive and "
        return [
            SetNumber(
                "rolling_radius_m", text + "squat make the accelerometer read 1 to 7 % more: no more than a check"
            )
        ]
    return [SetNumber("rolling_radius_m", "no speed over ground and no accelerometer: nothing shows it")]

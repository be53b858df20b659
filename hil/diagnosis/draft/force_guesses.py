"""Guesses of the channels of brakes, motors and pedals, and what they give for the vehicle set."""

from collections.abc import Mapping

import numpy as np

from hil.diagnosis.data.log import MOTOR_DEMAND, MOTOR_TORQUE, PRESSURE, PRESSURE_DEMAND, WHEELS, Floats
from hil.diagnosis.data.units import OF_CHANNEL, written
from hil.diagnosis.draft.forces import Brakes, Forced, find_brakes, find_motors, find_share, share_unit
from hil.diagnosis.draft.guess import Guess, SetNumber
from hil.diagnosis.draft.signals import Signal

_SHOWS = 0.6
_USUAL = ("bar", "mpa", "kpa", "pa")
_AFTER_S = 0.2
"""Lag behind the deceleration that is no filter's: motors that brake first leave up to 0.15 s beside it."""
_TORQUES = ("torques are those at the wheels, gear ratio counted; driving is positive",)
_GAIN = "brake_gain_front_nm_pa"


def brake_guesses(signals: Mapping[str, Signal], motion: Forced) -> tuple[list[Guess], list[SetNumber]]:
    """Guesses of the pressures, measured and demanded, and the product that the stops give."""
    guesses: list[Guess] = []
    numbers: list[SetNumber] = []
    for demand, channels in ((False, PRESSURE), (True, PRESSURE_DEMAND)):
        found = find_brakes(signals, motion, demand)
        if found is None:
            continue
        unit, complete, unknown = _unit(found)
        sign = -1 if _shown(found) and found.per_unit > 0.0 else 1
        one_for_all = len({one.name for one in found.signals.values()}) == 1
        if one_for_all:
            unknown.append(
                "whose pressure it is: one signal for four wheels (master cylinder, a circuit, or a request)"
            )
        check: tuple[str, ...] = ("pressures are positive",)
        if _shown(found) and found.evidence is not None and found.evidence.lag_s > _AFTER_S:
            check = (*check, "its stamps: the car slows before it, which no brake does")
        if not complete:
            check = (*check, "with a scale here, add both brake gains to `required` in the vehicle set")
        measured = []
        if _shown(found):
            low, high = sorted(map(abs, found.per_unit_ci))
            measured.append(
                f"one {written(unit) if unit else 'unit'} slows the car by {abs(found.per_unit):.4g} "
                f"({low:.4g} to {high:.4g}) m/s2"
            )
        for k, (wheel, channel) in enumerate(zip(WHEELS, channels, strict=True)):
            first = not k
            guesses.append(
                Guess(
                    channel, found.signals[wheel].name, unit, sign, None, complete,
                    ("name", "unit stated" if found.stated == unit and unit else "unit guessed"),
                    found.evidence if first else None, tuple(measured) if first else (),
                    tuple(unknown) if first else (), check if first else (),
                    found.others if first else (),
                )
            )  # fmt: skip
        if _shown(found) and not (demand and numbers):
            numbers += _product(found, unit)
    return guesses, numbers


def _shown(found: Brakes) -> bool:
    return found.evidence is not None and abs(found.evidence.correlation) > _SHOWS and found.per_unit != 0.0


def _unit(found: Brakes) -> tuple[str, bool, list[str]]:
    """Unit, whether the map can have it, and what is open."""
    fitting = ", ".join(written(unit) for unit in found.units)
    if found.stated:
        unusual = _shown(found) and found.stated not in found.units
        said = f"the unit stated is {written(found.stated)}; a road car's brakes say: {fitting or 'none'}"
        return found.stated, True, [said] if unusual else []
    if not _shown(found):
        return "", False, ["its unit and scale: too little braking shows in the motion"]
    usual = [unit for unit in found.units if unit in _USUAL]
    if len(usual) == 1 and not _counts(found):
        return usual[0], True, [f"its unit: of the usual ones only {written(usual[0])} makes a road car's brakes of it"]
    makes = f"{fitting or 'no unit of pressure'} would make a road car of it; or a tenth of a bar, or a torque"
    return "", False, [f"its unit and scale ({makes}): the motion gives the product with the brake gains alone"]


def _counts(found: Brakes) -> bool:
    """Whether all values are whole numbers: counts, whose scale can be anything."""
    values = next(iter(found.signals.values())).values
    grid = values[np.isfinite(values)]
    return bool(np.mean(np.abs(grid - np.round(grid)) < 1e-6) > 0.5 and np.ptp(grid) > 100.0)


def _product(found: Brakes, unit: str) -> list[SetNumber]:
    """Sum of the brake gains over mass and radius."""
    factor = OF_CHANNEL["pressure"].get(unit, 1.0)
    low, high = sorted(abs(bound) / factor for bound in found.per_unit_ci)
    of = "Pa" if unit else "unit of the signal"
    text = (
        f"2 (front + rear) / (mass_kg rolling_radius_m) = {abs(found.per_unit) / factor:.4g} ({low:.4g} to "
        f"{high:.4g}) m/s2 per {of}: the sum of the gains given mass and radius, not the share of an axle"
    )
    return [SetNumber(_GAIN, text)]


def motor_guesses(signals: Mapping[str, Signal], motion: Forced, moving: Floats) -> list[Guess]:
    """Guesses of the motor torques, measured and demanded."""
    guesses = []
    for demand, channels in ((False, MOTOR_TORQUE), (True, MOTOR_DEMAND)):
        found = find_motors(signals, motion, moving, demand)
        if found is None:
            continue
        seen = found.evidence
        shown = seen is not None and abs(seen.correlation) > _SHOWS
        sign = -1 if shown and seen is not None and seen.ratio < 0.0 else 1
        unknown = [] if shown else ["sign and scale: other forces move the car more"]
        by_wheel = dict(zip(WHEELS, channels, strict=True))
        for k, (wheel, signal) in enumerate(found.signals.items()):
            guesses.append(
                Guess(
                    by_wheel[wheel], signal.name, found.stated or "nm", sign, None, True,
                    ("name", "unit stated" if found.stated else "unit guessed"), seen if not k else None,
                    unknown=tuple(unknown) if not k else (),
                    check=_TORQUES if not k else (),
                )
            )  # fmt: skip
    return guesses


def share_guesses(signals: Mapping[str, Signal], accel: Floats, moving: Floats) -> list[Guess]:
    """Guesses of brake pedal, throttle and state of charge."""
    guesses = []
    for channel in ("pedal", "throttle", "soc"):
        found = find_share(signals, channel, accel, moving)
        if found is not None:
            signal, seen, others = found
            basis = ("name", "unit stated" if signal.unit else "unit guessed")
            guesses.append(Guess(channel, signal.name, share_unit(signal), basis=basis, evidence=seen, others=others))
    return guesses

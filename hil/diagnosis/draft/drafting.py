"""From the signals of a stranger's logs to a draft: each channel's guess, the numbers of the set, and what is open."""

import math
from dataclasses import replace

from hil.diagnosis.data.log import UnusableError, four
from hil.diagnosis.draft.force_guesses import brake_guesses, motor_guesses, share_guesses
from hil.diagnosis.draft.forces import Forced, motor_sums, pressure_sums
from hil.diagnosis.draft.guess import Draft, Guess
from hil.diagnosis.draft.motion_guesses import (
    ax_guess,
    filtered_accel,
    measured_scales,
    rolling_radius,
    speed_guesses,
)
from hil.diagnosis.draft.names import kinds, quantity
from hil.diagnosis.draft.signals import Signals, rejected
from hil.diagnosis.draft.speeds import Speeds, find_speeds
from hil.diagnosis.draft.turn_guesses import turn_guesses
from hil.diagnosis.draft.unit_choice import unit_choices

_ALWAYS = ("mass_kg", "wheelbase_m", "cog_to_front_axle_m", "rolling_radius_m")
_GAINS = ("brake_gain_front_nm_pa", "brake_gain_rear_nm_pa")
_LATE_S = 0.25
"""Lag beyond which `explain` moves a channel instead of estimating its lag."""
_SENSORS = ("wheel_speed", "speed", "ax", "ay", "yaw")
"""Channels of the motion itself: a pedal or a pressure may well be early."""


def draft(signals: Signals) -> Draft:
    """Draft the map and the set of a car.

    Raises
    ------
    UnusableError
        No signal shows a speed: nothing else can be named without one.
    """
    usable = signals.usable
    speeds = find_speeds(usable)
    if speeds is None:
        listed = ", ".join(list(signals.by_name)[:20])
        raise UnusableError(
            f"{', '.join(signals.files)}: no four wheel speeds and no speed found, and everything else is judged by "
            f"them; signals seen: {listed or 'none'}; is the DBC that of this car, are wheel speeds among the columns?"
        )
    scales = measured_scales(speeds)
    choices = unit_choices(scales)
    units = choices[0]
    accel, speed = filtered_accel(speeds, units), speeds.reference * units.wheel_to_mps
    taken = {one.name for one in (*speeds.wheels.values(), *speeds.ground[:1])} | {
        one.name for one, _ in speeds.accelerometers
    }
    rest = {name: one for name, one in usable.items() if name not in taken}
    guesses = [*speed_guesses(speeds, units, choices, scales), *ax_guess(speeds, units)]
    turns, numbers, remarks = turn_guesses(rest, speeds, units, speed)
    guesses += turns
    brakes, products = brake_guesses(rest, Forced(accel, speed, motor_sums(rest)))
    guesses += [
        *brakes,
        *motor_guesses(rest, Forced(accel, speed, pressure_sums(rest)), speeds.moving),
        *share_guesses(rest, accel, speeds.moving),
    ]
    numbers = [*rolling_radius(speeds, units, scales), *numbers, *products]
    mapped = {one.channel for one in guesses if one.complete}
    braked = any(name.startswith("pressure") for name in mapped)
    required = (*_ALWAYS, *(_GAINS if braked else ()))
    used = taken & {one.signal for one in guesses} | {one.signal for one in guesses}
    mentioned = {name for one in guesses for name in one.others}
    named = [
        name
        for name in signals.by_name
        if kinds(name, signals.by_name[name].unit) or quantity(signals.by_name[name].unit)
    ]
    return Draft(
        signals.files, signals.time, tuple(map(_with_lag_word, guesses)), tuple(numbers), required,
        (*_remarks(speeds, mapped), *remarks), rejected(signals, named),
        tuple(name for name in usable if name not in used | mentioned),
    )  # fmt: skip


def _with_lag_word(guess: Guess) -> Guess:
    """With a word on a lag that is more than `explain` estimates."""
    if guess.evidence is None or abs(guess.evidence.lag_s) <= _LATE_S or not guess.channel.startswith(_SENSORS):
        return guess
    if math.isnan(guess.evidence.lag_s):
        word = "its stamps: the best lag is the longest that was looked for, so it is not determined"
        return replace(guess, check=(*guess.check, word))
    return replace(
        guess, check=(*guess.check, "its stamps: farther off than a filter makes it; explain moves it or refuses it")
    )


def _remarks(speeds: Speeds, mapped: set[str]) -> list[str]:
    remarks = []
    forces = [set(four(stem, unit)) <= mapped for stem, unit in (
        ("pressure", "pa"), ("pressure_demand", "pa"), ("motor_torque", "nm"), ("motor_torque_demand", "nm"),
    )]  # fmt: skip
    if not any(forces):
        remarks.append(
            "neither pressures nor torques of all wheels are known in SI: explain compares the sensors with the motion"
        )
    elif not any(forces[2:]):
        remarks.append(
            "what propels the car is not measured: explain simulates only logs in which it hardly gains speed, and "
            "compares sensors and stops otherwise"
        )
    if not speeds.accelerometers:
        remarks.append("no accelerometer: signs and scales along the car rest on names and ranges alone")
    return remarks

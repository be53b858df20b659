"""Guesses of the channels that show how the car turns, and the geometry that they give."""

from collections.abc import Mapping

import numpy as np

from hil.diagnosis.data.log import Floats
from hil.diagnosis.data.trial.motion import filtered
from hil.diagnosis.data.units import OF_CHANNEL
from hil.diagnosis.draft.guess import Guess, SetNumber
from hil.diagnosis.draft.names import known_unit
from hil.diagnosis.draft.signals import Signal
from hil.diagnosis.draft.speeds import Speeds
from hil.diagnosis.draft.turning import Turn, find_lateral, find_steering, find_yaw, yaw_by_wheels
from hil.diagnosis.draft.unit_choice import UnitChoice

_TRACK_M = 1.55
_POSITIVE = "a turn to the left must read positive"
_STRAIGHT_RAD = 0.02
"""Angle straight ahead, rad, that explain estimates by itself (`hil.diagnosis.vehicle.priors`, two deviations)."""
_SHARE = 0.05
"""Half-width of a length, as a share, up to which the set takes it."""


def turn_guesses(
    signals: Mapping[str, Signal], speeds: Speeds, units: UnitChoice, speed: Floats
) -> tuple[list[Guess], list[SetNumber], list[str]]:
    """Guesses, numbers of the set and remarks; ``speed`` (rows,) m/s."""
    guesses: list[Guess] = []
    numbers: list[SetNumber] = []
    moving = speeds.moving
    across = _across(speeds, units)
    yaw = None if across is None else find_yaw(signals, across, moving)
    known = yaw is not None and yaw.known
    if yaw is not None:
        guesses.append(_guess("yaw_rate_rad_s", yaw, "the wheels of right and left", by_name=speeds.by_name))
        if known and yaw.evidence is not None:
            numbers += _track(yaw, units)
    if known and yaw is not None:
        rate = filtered(yaw.signal.values * OF_CHANNEL["yaw_rate"][yaw.unit]) * yaw.sign
    elif across is not None:
        rate = across / _TRACK_M
    else:
        return guesses, numbers, []
    lateral = find_lateral(signals, rate * speed, moving, known)
    if lateral is not None:
        guesses.append(_guess("ay_mps2", lateral, "speed times yaw rate", by_name=speeds.by_name))
    steer = find_steering(signals, rate, speed, moving)
    if steer is not None:
        guesses.append(_steer(steer))
        numbers += _wheelbase(steer)
    return guesses, numbers, _side(guesses, speeds)


def _across(speeds: Speeds, units: UnitChoice) -> Floats | None:
    """Right less left wheel, m/s, by the axle that the speed is taken from; None where wheels are unknown."""
    if not speeds.wheels or not speeds.by_name:
        return None
    if speeds.source == "the front wheels":
        return yaw_by_wheels(speeds.wheels, units.wheel_to_mps, "f")
    if speeds.source == "the rear wheels":
        return yaw_by_wheels(speeds.wheels, units.wheel_to_mps, "r")
    front, rear = (yaw_by_wheels(speeds.wheels, units.wheel_to_mps, axle) for axle in "fr")
    return 0.5 * (front + rear)


def _guess(channel: str, turn: Turn, by: str, by_name: bool) -> Guess:
    stated = known_unit(turn.signal.unit)
    basis = ["name", "unit stated" if stated and stated == turn.unit else "unit guessed"]
    unknown, check = [], []
    if not turn.known:
        size = "not at all" if turn.evidence is None else f"with a correlation of {turn.evidence.correlation:.2f} only"
        unknown.append(f"sign and scale: it goes with {by} {size}; drive bends")
    elif turn.sign < 0:
        unknown.append(
            "whether this sign is turned, or left and right of the wheels: the wheels' names are taken as right"
        )
    if turn.known and stated and stated != turn.unit:
        unknown.append(f"the unit stated is {stated}: the measurement contradicts it")
    check.append(_POSITIVE)
    return Guess(
        channel, turn.signal.name, turn.unit, turn.sign, basis=tuple(basis), evidence=turn.evidence,
        unknown=tuple(unknown), check=tuple(check), others=turn.others,
    )  # fmt: skip


def _steer(turn: Turn) -> Guess:
    stated = known_unit(turn.signal.unit)
    unit, sign = stated, turn.sign
    unknown, measured = [], [f"{turn.offset:.5g} straight ahead"]
    offset = None
    if turn.known:
        measured.append(
            f"wheelbase times steering ratio: {turn.implied:.4g} m (a steering wheel's is 30 to 60 m; some 3 m is the "
            "angle of the road wheels: steering_ratio = 1)"
            if stated
            else f"wheelbase times steering ratio: {turn.implied:.4g} m per unit of the signal (30 to 60 m in rad)"
        )  # fmt: skip
    if not stated and turn.known:
        fitting = [one for one in ("rad", "deg") if 25.0 < turn.implied * OF_CHANNEL["steer"][one] < 65.0]
        unit = fitting[0] if len(fitting) == 1 else ""
        if not unit:
            unknown.append("its scale: only the product with wheelbase and steering ratio")
    if not turn.known:
        unknown.append("sign and scale: no bend shows them")
    complete = bool(unit)
    if unit and turn.known and abs(turn.offset * OF_CHANNEL["steer"][unit]) > _STRAIGHT_RAD:
        offset = -sign * turn.offset * OF_CHANNEL["steer"][unit]
        measured.append("taken off with offset, in rad")
    return Guess(
        "steer_rad", turn.signal.name, unit, sign, offset, complete,
        ("name", "unit stated" if stated else "unit guessed"), turn.evidence, tuple(measured), tuple(unknown),
        (_POSITIVE.replace("a turn", "steering"),), turn.others,
    )  # fmt: skip


def _track(yaw: Turn, units: UnitChoice) -> list[SetNumber]:
    """The track, where the wheels' speed and the gyro are known in SI."""
    seen = yaw.evidence
    assert seen is not None
    low, high = sorted(yaw.implied * seen.ratio / bound if bound else np.inf for bound in (seen.low, seen.high))
    half = 0.5 * (high - low)
    text = (
        f"right less left wheels per yaw rate: {yaw.implied:.3f} m ({low:.3f} to {high:.3f}), correlation "
        f"{abs(seen.correlation):.3f}"
    )
    if units.radius_m is not None:
        text += f", at a radius of {units.radius_m:.3f} m"
    good = half < _SHARE * yaw.implied and 1.0 < yaw.implied < 2.3 and abs(seen.correlation) > 0.95
    if not good:
        return [SetNumber("track_m", f"{text}: too rough for the set")]
    return [SetNumber("track_m", text, round(yaw.implied, 3), max(round(float(half), 3), 0.03))]


def _wheelbase(steer: Turn) -> list[SetNumber]:
    if not steer.known or steer.evidence is None:
        return [SetNumber("steering_ratio", "no bend shows how steering and yaw rate go together")]
    stated = known_unit(steer.signal.unit)
    unit = "" if stated else " per unit of the signal"
    text = (
        f"steering angle times speed per yaw rate: wheelbase x steering_ratio = {steer.implied:.4g} m{unit}, with "
        "understeer; neither alone"
    )
    return [SetNumber("steering_ratio", text)]


def _side(guesses: list[Guess], speeds: Speeds) -> list[str]:
    """What all signs together say of left and right."""
    shown = [one for one in guesses if one.evidence is not None and abs(one.evidence.correlation) >= 0.8]
    turned = [one.channel for one in shown if one.sign < 0]
    if len(shown) > 1 and len(turned) == len(shown):
        return [
            f"{', '.join(turned)} all turn against the wheels: either they are positive to the right, or left and "
            "right of the wheels are exchanged; nothing in the logs tells which"
        ]
    return []

"""Scores of cars that strangers wrote: false alarms, true causes first or among the tied, false ones beside."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hil.validation.blind_trials.metrics import Metrics, Record, median, share
from hil.validation.blind_trials.parameters import coverage
from hil.validation.blind_trials.reading import answers

FALSE_ALARMS, RIGHT, FALSE_BESIDE = 0.05, 0.7, 0.1
"""Marks over all cars together."""
WORSE = 1.01
"""Held-out error after naming over that of the nuisance parameters alone, from which a channel is worse."""

SIZE_ERROR, SIZE_COVERED = 0.1, (0.9, 0.99)
"""Marks of the numbers of right first causes: the median of the relative error, and how many intervals hold them."""
_PADS = {"pad_mu_gain.gain": 1.0, "caliper_asymmetry.gain": 1.0, "stuck_corner.loss": -1.0}
_ZERO = {"imu_bias.ax_mps2": 1.0}
_SCALE = {"imu_gain.gain": 1.0, "wrong_scale.gain": 1.0}
SAME_NUMBER: Mapping[str, Mapping[str, float]] = {
    "front_pads_weak": _PADS, "wheel_pads_weak": _PADS, "front_pads": _PADS, "rear_linings": _PADS,
    "weak_corner": _PADS, "brake_drags": {"residual_drag.torque_nm": 1.0},
    "dragging_brake": {"residual_drag.torque_nm": 1.0}, "dragging_calliper": {"residual_drag.torque_nm": 1.0},
    "loaded": {"mass_offset.mass_kg": 1.0}, "overloaded": {"mass_offset.mass_kg": 1.0},
    "passengers": {"mass_offset.mass_kg": 1.0}, "rear_motors_weak": {"iwm_gain.gain": 1.0, "iwm_gain.unseen": 1.0},
    "weak_motor": {"iwm_gain.gain": 1.0, "iwm_gain.unseen": 1.0}, "wheel_radius": {"tyre_radius.gain": 1.0},
    "worn_tyre": {"tyre_radius.gain": 1.0}, "accelerometer_zero": _ZERO, "imu_zero": _ZERO,
    "accelerometer_scale": _SCALE, "imu_scale": _SCALE, "pressure_scale": {"pressure_gain.gain": 1.0},
    "pressure_zero": {"pressure_offset.offset_pa": 1.0}, "slope": {"road_grade.grade": 1.0},
}  # fmt: skip
"""Numbers of our effects that are the number a cause changes (with this factor), by the name of the cause. Others are
of equations unlike a stranger's own: a fade, a law of speed or pressure, a wind on another body."""


def is_right(record: Record) -> bool:
    """Whether the first cause is the hidden one, or one that it is told not to be distinguished from is."""
    return bool(record["causes"]) and (_accepts(record, record["causes"][0]) or _tied(record))


def something_false(record: Record) -> bool:
    """Whether a cause is named that is not the hidden one; the first of a tie with it is none."""
    named = record["causes"][1:] if _tied(record) else record["causes"]
    return any(not _accepts(record, cause) for cause in named)


def held_out_worse(record: Record) -> bool:
    """Whether the causes named make a channel of the held-out manoeuvres worse than none do."""
    return any(error["after"] > WORSE * error["tuned"] for error in record["held_out_error"].values())


def null(records: Sequence[Record]) -> Metrics:
    """Drives with nothing hidden, of all cars and of each."""
    found = {"false_alarm": share(records, answers, FALSE_ALARMS, at_most=True)}
    found |= _by_car("false_alarm", records, answers)
    return found | {"held_out_worse": share(records, held_out_worse, 0.0, at_most=True)}


def single(records: Sequence[Record]) -> Metrics:
    """Drives with one cause, of all cars and of each."""
    of = [record for record in records if record["reached"]]
    right = [record for record in of if is_right(record)]
    numbers = [found for record in right if (found := _number(record)) is not None]
    errors = [abs(value / true - 1.0) for true, value, _ in numbers]
    covered = [low <= true <= high for true, _, (low, high) in numbers]
    return {
        "right": share(of, is_right, RIGHT), **_by_car("right", of, is_right),
        "first": share(of, lambda r: bool(r["causes"]) and _accepts(r, r["causes"][0])),
        "something_false": share(of, something_false, FALSE_BESIDE, at_most=True),
        "false_beside_the_right": share(right, something_false),
        "size_error": median(errors, SIZE_ERROR, at_most=True), "size_coverage95": coverage(covered, *SIZE_COVERED),
        "nothing_named": share(of, lambda r: not answers(r)),
        "held_out_worse": share(records, held_out_worse, 0.0, at_most=True),
    }  # fmt: skip


def _by_car(name: str, records: Sequence[Record], hit: Callable[[Record], bool]) -> Metrics:
    cars = sorted({record["car"] for record in records})
    return {f"{name}_{car}": share([r for r in records if r["car"] == car], hit) for car in cars}


def _accepts(record: Record, cause: Mapping[str, Any]) -> bool:
    return bool({cause["effect"], f"{cause['effect']}@{cause['location']}"} & set(record["accepted"]))


def _number(record: Record) -> tuple[float, float, tuple[float, float]] | None:
    """Hidden size, the first cause's and its 95 % interval; None where it has no such number."""
    (hidden,), first = record["hidden"], record["causes"][0]
    for same, factor in SAME_NUMBER.get(hidden["effect"], {}).items():
        effect, name = same.split(".")
        if effect == first["effect"] and name in first["parameters"] and _accepts(record, first):
            found = first["parameters"][name]
            low, high = sorted(factor * bound for bound in found["ci95"])
            return hidden["parameters"]["size"]["value"], factor * found["value"], (low, high)
    return None


def _tied(record: Record) -> bool:
    """Whether the answer is a tie, and the hidden cause among the rivals."""
    rivals = {*record["rivals"], *record["rivals_at"]}
    return record["verdict"] == "cannot_tell_apart" and bool(rivals & set(record["accepted"]))

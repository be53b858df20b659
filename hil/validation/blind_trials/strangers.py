"""Scores of cars that strangers wrote: false alarms, true causes first or among the tied, false ones beside."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hil.validation.blind_trials.metrics import Metrics, Record, share
from hil.validation.blind_trials.reading import answers

FALSE_ALARMS, RIGHT, FALSE_BESIDE = 0.05, 0.7, 0.1
"""Marks over all cars together."""
WORSE = 1.01
"""Held-out error after naming over that of the nuisance parameters alone, from which a channel is worse."""


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
    return {
        "right": share(of, is_right, RIGHT), **_by_car("right", of, is_right),
        "first": share(of, lambda r: bool(r["causes"]) and _accepts(r, r["causes"][0])),
        "something_false": share(of, something_false, FALSE_BESIDE, at_most=True),
        "false_beside_the_right": share(right, something_false),
        "nothing_named": share(of, lambda r: not answers(r)),
        "held_out_worse": share(records, held_out_worse, 0.0, at_most=True),
    }  # fmt: skip


def _by_car(name: str, records: Sequence[Record], hit: Callable[[Record], bool]) -> Metrics:
    cars = sorted({record["car"] for record in records})
    return {f"{name}_{car}": share([r for r in records if r["car"] == car], hit) for car in cars}


def _accepts(record: Record, cause: Mapping[str, Any]) -> bool:
    return bool({cause["effect"], f"{cause['effect']}@{cause['location']}"} & set(record["accepted"]))


def _tied(record: Record) -> bool:
    """Whether the answer is a tie, and the hidden cause among the rivals."""
    rivals = {*record["rivals"], *record["rivals_at"]}
    return record["verdict"] == "cannot_tell_apart" and bool(rivals & set(record["accepted"]))

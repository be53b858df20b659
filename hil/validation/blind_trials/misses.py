"""The cases of a family that were answered wrong, one line each: what was hidden, and what was answered."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hil.validation.blind_trials import reading, strangers
from hil.validation.blind_trials.metrics import Record
from hil.validation.blind_trials.separable import separable

_SURE = 8.0
"""Signal-to-noise ratio from which a single cause should be named."""
_RIGHT: Mapping[str, Callable[[Record], bool]] = {
    "null": lambda r: not reading.answers(r),
    "single": lambda r: reading.is_top(r) or (reading.in_set(r) and not separable(r)),
    "onset": reading.is_top,
    "two": reading.is_exact,
    "three": reading.is_exact,
    "unlisted": reading.right_law,
    "confounded": lambda r: not reading.claims(r) and reading.decided(r),
    "twin": lambda r: not reading.claims(r) or reading.is_top(r),
    "not_testable": reading.called_not_testable,
    "strangers": lambda r: not reading.answers(r),
    "strangers_single": lambda r: strangers.is_right(r) and not strangers.something_false(r),
    "strangers_reference": lambda r: not reading.answers(r),
    "strangers_reference_single": lambda r: strangers.is_right(r) and not strangers.something_false(r),
}


def misses(family: str, records: Sequence[Record]) -> list[str]:
    """Cases of a family whose answer is wrong; none for a score of another family's cases.

    Left out are those that a physical bound keeps from their ratio, and single causes below a ratio of 8.
    """
    right = _RIGHT.get(family)
    if right is None:
        return []
    scored = (r for r in records if r["reached"] and (r["size"] is None or r["size"] >= _SURE))
    return [_line(record) for record in scored if not right(record)]


def _line(record: Record) -> str:
    size = "" if record["size"] is None else f" at {record['size']:g}"
    car = f" {record['car']}" if "car" in record and not record["hidden"] else ""
    line = f"{record['index']}{car}{size}: {_causes(record['hidden'])}; answered {_answered(record)}"
    return f"{line}; then {_answered(record['follow_up'])}" if "follow_up" in record else line


def _answered(record: Record) -> str:
    if not record["causes"]:
        return str(record["verdict"]).replace("_", " ")
    rivals = f", or {', '.join(record['rivals'])}" if record["rivals"] else ""
    return _causes(record["causes"]) + rivals


def _causes(causes: Sequence[Mapping[str, Any]]) -> str:
    return " and ".join(f"{cause['effect']}@{cause['location']}{_size(cause)}" for cause in causes) or "nothing hidden"


def _size(cause: Mapping[str, Any]) -> str:
    """The first number of a cause, if it has any."""
    for number in cause["parameters"].values():
        return f" {number['value']:.3g} {number['unit']}".rstrip()
    return ""

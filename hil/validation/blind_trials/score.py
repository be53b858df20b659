"""Scores of blind trials, family by family, against the pass marks."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from hil.validation.blind_trials import strangers
from hil.validation.blind_trials.calibration import calibration
from hil.validation.blind_trials.detection import detection_limits
from hil.validation.blind_trials.gain import gain, gain_of_oracle
from hil.validation.blind_trials.metrics import Metrics, Record, mean, median, share
from hil.validation.blind_trials.misses import misses
from hil.validation.blind_trials.parameters import parameters
from hil.validation.blind_trials.reading import (
    answers,
    called_not_testable,
    claims,
    decided,
    hidden_names,
    in_set,
    is_exact,
    is_found,
    is_top,
    isolation_probability,
    names_listed_elsewhere,
    right_injection_point,
    right_law,
)
from hil.validation.blind_trials.separable import separable
from hil.validation.reference_car.catalogue import TWINS

Records = Sequence[Record]


def table_of(family: str, records: Records) -> dict[str, Any]:
    """``n``, ``sources``, ``metrics`` {name: {value, low, high, pass_mark, met}} and ``missed`` of a family.

    ``sources`` are the states of the program that the cases were run with, {digest: number of cases}.
    ``value`` is None where no case counts; ``met`` None without a pass mark. ``single`` has ``detection_limits``
    {effect: signal-to-noise ratio, None where never found} beside.
    """
    states = Counter(record["sources"] for record in records)
    entry: dict[str, Any] = {
        "n": len(records), "sources": dict(states), "metrics": _SCORED[family](records),
        "missed": misses(family, records),
    }  # fmt: skip
    if family == "single":
        entry["detection_limits"] = detection_limits(records)
    return entry


def _reached(records: Records) -> Records:
    """Those that reach the signal-to-noise ratio of their family: no physical bound came first."""
    return [record for record in records if record["reached"]]


def _null(records: Records) -> Metrics:
    found = {"false_alarm": share(records, answers, 0.01, at_most=True)}
    for level in sorted({record["noise"] for record in records}):
        found[f"false_alarm_{level}_noise"] = share([r for r in records if r["noise"] == level], answers)
    return found


def _single(records: Records) -> Metrics:
    """The first name counts where causes are separable (`hil.validation.blind_trials.separable`).

    The isolation probability is that of the hidden effect where anything is named, and of all cases
    (`hil.validation.blind_trials.isolation`).
    """
    found: Metrics = {}
    for size in sorted({record["size"] for record in records}):
        of = _reached([record for record in records if record["size"] == size])
        sure = size >= 8.0
        found[f"detected_snr{size:g}"] = share(of, answers, 0.95 if sure else None)
        apart = [record for record in of if separable(record)]
        found[f"top1_snr{size:g}"] = share(apart, is_top, {8.0: 0.9, 15.0: 0.97}.get(size))
        found[f"top1_of_all_snr{size:g}"] = share(of, is_top)
        found[f"in_set_snr{size:g}"] = share(of, in_set, 0.99 if sure else None)
        found[f"isolation_probability_snr{size:g}"] = mean([isolation_probability(r) for r in of if answers(r)])
        found[f"isolation_probability_of_all_snr{size:g}"] = mean([isolation_probability(r) for r in of])
    return found


def _onset(records: Records) -> Metrics:
    """These have the pass marks of single causes, and no others."""
    of = _reached(records)
    right = [record for record in of if is_top(record)]
    given = [r for r in right if r["causes"][0].get("onset_s") is not None]
    return {
        "detected": share(of, answers), "top1": share(of, is_top), "in_set": share(of, in_set),
        "onset_given": share(right, lambda r: r["causes"][0].get("onset_s") is not None),
        "onset_error_s": median([abs(r["causes"][0]["onset_s"] - r["hidden"][0]["onset_s"]) for r in given]),
    }  # fmt: skip


def _two(records: Records) -> Metrics:
    return {
        "exact_set": share(records, is_exact, 0.85),
        "both_found": share(records, lambda r: hidden_names(r) <= set(r["named"]), 0.95),
        "extra_term": share(records, lambda r: bool(set(r["named"]) - hidden_names(r)), 0.05, at_most=True),
    }


def _three(records: Records) -> Metrics:
    return {
        "all_found": share(records, lambda r: hidden_names(r) <= set(r["named"]), 0.75),
        "exact_set": share(records, is_exact),
        "extra_term": share(records, lambda r: bool(set(r["named"]) - hidden_names(r))),
    }


def _unlisted(records: Records) -> Metrics:
    of = _reached(records)
    return {
        "unlisted_or_right_point": share(of, right_law, 0.85),
        "right_injection_point": share(of, right_injection_point),
        "wrong_listed_name": share(of, names_listed_elsewhere, 0.05, at_most=True),
        "gain_of_oracle": gain_of_oracle(of, 0.8),
    }


def _confounded(records: Records) -> Metrics:
    return {
        "single_cause_claimed": share(records, claims, 0.02, at_most=True),
        "follow_up_decides": share(records, decided, 0.9),
        "in_set": share(records, in_set),
    }


def _twin(records: Records) -> Metrics:
    """Who answers with one cause must have the right side; abstaining is no error and counted apart."""
    of = _reached(records)
    answered = [record for record in of if claims(record)]
    return {
        "right_side_of_answered": share(answered, is_top, 0.95),
        "twin_named_of_answered": share(answered, _other_side),
        "abstained": share(of, lambda r: not claims(r)),
    }


def _other_side(record: Record) -> bool:
    pair = next(pair for pair in TWINS if record["hidden"][0]["effect"] in pair)
    return bool(record["named"]) and record["named"][0] in set(pair) - hidden_names(record)


def _not_testable(records: Records) -> Metrics:
    return {"called_not_testable": share(records, called_not_testable, 0.95), "hidden_named": share(records, is_found)}


_SCORED: dict[str, Callable[[Records], Metrics]] = {
    "null": _null, "single": _single, "two": _two, "three": _three, "onset": _onset, "unlisted": _unlisted,
    "confounded": _confounded, "twin": _twin, "not_testable": _not_testable,
    "parameters": lambda records: parameters(_reached(records)), "gain": gain, "calibration": calibration,
    "strangers": strangers.null, "strangers_single": strangers.single,
    "strangers_reference": strangers.null, "strangers_reference_single": strangers.single,
}  # fmt: skip

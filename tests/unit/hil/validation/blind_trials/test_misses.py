"""Which cases count as missed, and what is said of them."""

from typing import Any

import pytest

from hil.validation.blind_trials import FAMILIES
from hil.validation.blind_trials.misses import misses


def _cause(effect: str, wheel: str, value: float, unit: str = "") -> dict[str, Any]:
    return {
        "effect": effect,
        "injection_point": "",
        "location": wheel,
        "parameters": {"size": {"value": value, "unit": unit}},
    }


def _record(hidden: list[dict[str, Any]], answered: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    return {
        "index": 4, "size": None, "noise": "low", "reached": True, "hidden": hidden, "causes": answered,
        "rivals": [], "undetectable_effects": [], "named": [cause["effect"] for cause in answered],
        "verdict": "named" if answered else "none",
    } | more  # fmt: skip


MASS, WIND = _cause("mass_offset", "car", 113.04, "kg"), _cause("headwind", "car", -6.2, "m/s")
FADE = _cause("pad_temp_fade", "front", 0.000336, "1/K")


def test_an_alarm_says_what_was_answered_where_nothing_is_hidden() -> None:
    assert misses("null", [_record([], []), _record([], [WIND])]) == [
        "4: nothing hidden; answered headwind@car -6.2 m/s"
    ]  # fmt: skip


def test_a_single_cause_is_missed_by_another_name_or_none() -> None:
    records = [
        _record([MASS], [MASS], size=15.0),
        _record([MASS], [], size=15.0),
        _record([FADE], [WIND], size=8.0, rivals=["mass_offset"], verdict="cannot_tell_apart"),
    ]
    assert misses("single", records) == [
        "4 at 15: mass_offset@car 113 kg; answered none",
        "4 at 8: pad_temp_fade@front 0.000336 1/K; answered headwind@car -6.2 m/s, or mass_offset",
    ]


def test_what_may_be_missed_is_left_out() -> None:
    small, bounded = _record([MASS], [], size=5.0), _record([MASS], [], size=15.0, reached=False)
    assert misses("single", [small, bounded]) == []


def test_two_are_missed_when_one_is_missing_or_a_third_is_named() -> None:
    whole = _record([MASS, WIND], [WIND, MASS])
    half, more = _record([MASS, WIND], [MASS]), _record([MASS, WIND], [MASS, WIND, FADE])
    assert len(misses("two", [whole, half, more])) == 2
    assert misses("two", [half]) == [
        "4: mass_offset@car 113 kg and headwind@car -6.2 m/s; answered mass_offset@car 113 kg"
    ]


def test_a_confounded_case_is_missed_before_or_after_what_decides() -> None:
    then = _record([], [MASS])
    assert misses("confounded", [_record([MASS], [], follow_up=then)]) == []
    assert misses("confounded", [_record([MASS], [MASS], follow_up=then)])
    assert misses("confounded", [_record([MASS], [], follow_up=_record([], []))]) == [
        "4: mass_offset@car 113 kg; answered none; then none"
    ]


def test_abstaining_is_no_miss_of_a_twin_and_a_wrong_side_is() -> None:
    assert misses("twin", [_record([MASS], []), _record([MASS], [MASS])]) == []
    assert len(misses("twin", [_record([MASS], [WIND])])) == 1


def test_a_verdict_without_causes_is_put_in_words() -> None:
    line = misses("single", [_record([MASS], [], size=15.0, verdict="not_testable")])
    assert line == ["4 at 15: mass_offset@car 113 kg; answered not testable"]


@pytest.mark.parametrize("family", FAMILIES)
def test_no_cases_no_misses(family: str) -> None:
    assert misses(family, []) == []
